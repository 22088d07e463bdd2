// varimesh doctor: checks the machine and, if one is given, a server.
#include <fmt/format.h>
#include <google/protobuf/stubs/common.h>
#include <grpcpp/grpcpp.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <thread>

#include "client/cli/common_flags.h"
#include "client/client.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/process/child_program.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "client/process/temporary_folder.h"
#include "core/base/counted.h"
#include "core/base/version.h"
#include "core/device/card.h"
#include "core/device_kernels/judge/judge_check.h"
#include "core/device_kernels/self_check.h"
#include "core/geometry/cad_reader.h"
#include "core/process/helper_program.h"
#include "core/solvers/descent/on_device/descent_check.h"
#include "core/solvers/newton/device_check.h"

namespace varimesh::client {
namespace {

/// The result of one check.
struct Finding {
  std::string name;
  std::string found;
  std::string wrong;  ///< What is wrong and what to do; empty: nothing.
};

std::string protobuf_version() { return google::protobuf::internal::VersionString(GOOGLE_PROTOBUF_VERSION); }

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown";
}

Finding threads() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  const unsigned there = std::max(1U, std::thread::hardware_concurrency());
  const int usable =
      sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : static_cast<int>(there);
  return {"threads", fmt::format("{} of {} can be used", usable, sysconf(_SC_NPROCESSORS_ONLN)), ""};
}

Finding temporary_files() {
  std::error_code error;
  const auto folder = std::filesystem::temp_directory_path(error);
  const TemporaryFolder made;
  if (error || made.path().empty())
    return {"temporary files", folder.string(),
            "no folder can be made there; set TMPDIR to a folder where files can be made"};
  const auto space = std::filesystem::space(folder, error);
  return {"temporary files",
          fmt::format("{}, {:.1f} GiB free", folder.string(), static_cast<double>(space.available) / (1 << 30)),
          space.available < (std::uintmax_t{64} << 20)
              ? "less than 64 MiB are free; make room, or set TMPDIR to another folder"
              : ""};
}

/// A part that may be missing, and what needs it.
Finding optional_part(const std::string& name, const std::string& path, const std::string& purpose) {
  return {name, (path.empty() ? "missing" : path) + " (" + purpose + ")", ""};
}

/// The plugin that reads CAD models, with the program beside it, which reads their files.
Finding cad_plugin() {
  const std::string plugin = geometry::plugin_path();
  Finding found = optional_part("CAD plugin", plugin, "for --geometry, curve and mesh");
  if (!plugin.empty() && ::access(geometry::reader_path(plugin).c_str(), X_OK) != 0)
    found.wrong = "the program " + geometry::reader_path(plugin) + ", which reads CAD files, is missing; install " +
                  "VariMesh again";
  return found;
}

/// Whether the first card computes what the processor computes.
Finding kernels(const device::Driver& driver) {
  const auto card = driver.use();
  auto checked = card ? device::check_kernels(**card) : tl::unexpected(card.error());
  if (checked) checked = check_judgement(**card);
  if (checked) checked = check_newton(**card);
  if (checked) checked = check_descent(**card);
  if (checked) return {"device kernels", "compute the processor's bits", ""};
  const bool broken =
      checked.error().kind == device::Fault::Kind::BadKernels || checked.error().kind == device::Fault::Kind::Lost;
  return broken ? Finding{"device kernels", "do not work", checked.error().sentence}
                : Finding{"device kernels", checked.error().sentence, ""};
}

/// The cards of this machine, or why there is none, and whether they work. That there is none is not wrong.
std::vector<Finding> devices() {
  const auto driver = device::Driver::open();
  if (!driver) return {{"device", driver.error().sentence, ""}};
  const auto cards = driver->cards();
  if (!cards) return {{"device", cards.error().sentence, ""}};
  std::string found;
  for (const device::Properties& card : *cards)
    found += fmt::format("{}, {:.1f} GiB, compute capability {}.{}; ", card.name,
                         static_cast<double>(card.memory) / (1 << 30), card.capability / 10, card.capability % 10);
  const int version = cards->front().driver;
  found += fmt::format("driver for CUDA {}.{}", version / 1000, version % 1000 / 10);
  return {{"device", found, ""}, kernels(*driver)};
}

Finding server(const std::string& address, const Credentials& credentials) {
  const auto started = std::chrono::steady_clock::now();
  Settings settings;
  settings.connect = std::chrono::seconds(2);
  settings.retry = std::chrono::seconds(2);
  settings.credentials = credentials;
  auto client = Client::connect(address, settings);
  if (!client) return {"server", address, client.error().sentence};
  const auto info = client->info();
  if (!info) return {"server", address, info.error().sentence};
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - started;
  std::string found = fmt::format("{}, version {}, {}, {} running, {} waiting, answered in {:.0f} ms", address,
                                  info->version(), counted(info->limits().threads(), "thread"),
                                  counted(info->running_jobs(), "job"), info->pending_jobs(), took.count());
  const std::string own(version());
  const bool same = info->version().substr(0, info->version().rfind('.')) == own.substr(0, own.rfind('.'));
  return {"server", found,
          same ? "" : "the server has another version than this command; before 1.0 the two should be the same"};
}

void print_json(const std::vector<Finding>& findings) {
  Json json;
  for (const Finding& one : findings) json[one.name] = {{"found", one.found}, {"wrong", one.wrong}};
  print(json);
}

void print_table(const std::vector<Finding>& findings) {
  // Colours only on a terminal, and not if NO_COLOR is set: https://no-color.org
  const char* no_colour = std::getenv("NO_COLOR");
  const bool colour = isatty(STDOUT_FILENO) == 1 && (no_colour == nullptr || *no_colour == '\0');
  for (const Finding& one : findings) {
    const std::string_view mark = one.wrong.empty() ? "ok" : "no";
    std::cout << (colour ? (one.wrong.empty() ? "\x1b[32m" : "\x1b[31m") : "") << mark << (colour ? "\x1b[0m" : "")
              << fmt::format("  {:<17}{}\n", one.name, one.found);
    if (!one.wrong.empty()) std::cout << fmt::format("{:<21}{}\n", "", one.wrong);
  }
}

int doctor(const CommonFlags& flags) {
  end_at_first_interrupt();
  std::vector<Finding> findings{
      {"varimesh", std::string(version()), ""},
      {"grpc", grpc::Version(), ""},
      {"protobuf", protobuf_version(), ""},
      {"processor", processor(), ""},
      {"vectors", std::string(vector_instructions()), ""},
      threads(),
      temporary_files(),
      cad_plugin(),
      optional_part("gmsh", find_program("gmsh"), "for varimesh mesh"),
      optional_part("HDF5 program", find_helper("varimesh_hdf5", "VARIMESH_HDF5"),
                    "for .h5, .cgns, .pyfrm and .exo files"),
  };
  for (Finding& one : devices()) findings.push_back(std::move(one));
  if (!flags.server.empty()) findings.push_back(server(flags.server, flags.credentials));
  if (flags.json)
    print_json(findings);
  else
    print_table(findings);
  if (std::all_of(findings.begin(), findings.end(), [](const Finding& one) { return one.wrong.empty(); })) return kDone;
  return findings.back().name == "server" && !findings.back().wrong.empty() ? kServer : kJobFailed;
}

}  // namespace

Action add_doctor(Command program) {
  auto flags = std::make_shared<CommonFlags>();
  Command command = program.add_command(
      "doctor", "Check this machine and a server: versions, processor, threads, device, disk space");
  add_server_flag(command, flags.get());
  add_json_flag(command, flags.get());
  return [flags] { return doctor(*flags); };
}

}  // namespace varimesh::client
