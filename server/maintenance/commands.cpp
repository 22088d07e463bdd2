// The command lines of check, backup and health, and what they print.
#include "server/maintenance/commands.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/counted.h"
#include "server/maintenance/backup.h"
#include "server/maintenance/check.h"
#include "server/maintenance/health.h"

namespace varimesh::server {
namespace {

// Exit statuses, as those of the server.
constexpr int kDamaged = 1, kWrongUsage = 2, kCannot = 1;

void print_damage(const std::vector<std::string>& damage) {
  for (const std::string& sentence : damage) std::cout << sentence << '\n';
}

int fail(const Error& error) {
  std::cerr << "varimeshd: " << error.sentence << '\n';
  return kCannot;
}

int run_check(const std::string& state, bool repair) {
  const auto report = check_state(state, repair);
  if (!report) return fail(report.error());
  print_damage(report->damage);
  std::cout << counted(report->jobs, "job") << ", " << counted(report->files, "whole file") << " ("
            << report->unreferenced << " that no job refers to); "
            << (report->damage.empty() ? "nothing is damaged" : counted(report->damage.size(), "fault")) << ".\n";
  return report->damage.empty() ? 0 : kDamaged;
}

int run_backup(const std::string& state, const std::string& copy) {
  const auto report = back_up(state, copy);
  if (!report) return fail(report.error());
  print_damage(report->damage);
  if (report->kept_earlier) {
    std::cout << "The earlier backup in " << copy << " was not replaced; repair the state directory or delete the "
              << "damaged jobs, or name a new directory for a backup of what is left.\n";
    return kDamaged;
  }
  std::cout << counted(report->jobs, "job") << " and " << counted(report->files, "file") << " are in " << copy << " ("
            << report->copied << " copied now).\n";
  return report->damage.empty() ? 0 : kDamaged;
}

int run_health(const std::string& address) {
  const auto ready = is_ready(address, std::chrono::seconds(5));
  if (!ready) {
    std::cerr << "varimeshd: " << ready.error().sentence << '\n';
    return ready.error().kind == Error::Kind::BadOption ? kWrongUsage : kCannot;
  }
  std::cout << (*ready ? "ready\n" : "not ready\n");
  return *ready ? 0 : kCannot;
}

/// Parses the command line of a command and returns the exit status; nothing if the command can run.
std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc - 1, argv + 1);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  return std::nullopt;
}

int health(int argc, char** argv) {
  CLI::App app{"Asks a server whether it accepts jobs. Exit status: 0 if it does, 1 if it does not or nobody answers.",
               "varimeshd health"};
  std::string address;
  app.add_option("--metrics", address, "The server's --metrics (default: the environment variable VARIMESHD_METRICS)")
      ->envname("VARIMESHD_METRICS")
      ->required();
  const auto ended = parse(app, argc, argv);
  return ended ? *ended : run_health(address);
}

}  // namespace

void describe_commands(CLI::App& app) {
  app.add_subcommand("check", "Compare everything in the state directory with its digests, while no server uses it");
  app.add_subcommand("backup",
                     "Copy the state directory, also while a server uses it; the copy is a state directory too");
  app.add_subcommand("health", "Ask a server that has --metrics whether it accepts jobs");
}

std::optional<int> run_command(int argc, char** argv) {
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "health") return health(argc, argv);
  if (command != "check" && command != "backup") return std::nullopt;
  CLI::App app{command == "check"
                   ? "Reads every row and every file of a state directory that no server uses, and says what is "
                     "damaged or missing. Exit status: 0 if nothing is, otherwise 1."
                   : "Copies a state directory, also while a server uses it. The copy is a state directory itself: to "
                     "restore it, start varimeshd with it as --state. Exit status: 0 if everything was copied, "
                     "otherwise 1.",
               "varimeshd " + std::string(command)};
  std::string state, copy;
  bool repair = false;
  app.add_option("--state", state, "The directory of the server (default: the environment variable VARIMESH_STATE)")
      ->envname("VARIMESH_STATE")
      ->required();
  if (command == "check")
    app.add_flag("--repair", repair,
                 "Move damaged files to the folder 'damaged', so that the server takes them again, and take damaged "
                 "jobs out of the queue");
  else
    app.add_option("COPY", copy, "The directory of the backup, new or with an earlier backup")->required();
  if (const auto ended = parse(app, argc, argv)) return *ended;
  return command == "check" ? run_check(state, repair) : run_backup(state, copy);
}

}  // namespace varimesh::server
