// varimesh info: shows a server's version, its limits and what it accepts.
#include <fmt/format.h>

#include <iostream>

#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/jobs/connection.h"
#include "client/process/exit_status.h"
#include "core/device/card.h"
#include "core/process/helper_program.h"

namespace varimesh::client {
namespace {

/// The card that runs of this command may have; empty: there is none, or it is too old.
std::string first_card() {
  const auto driver = device::Driver::open();
  const auto cards = driver ? driver->cards() : tl::unexpected(driver.error());
  return cards && device::is_new_enough(cards->front()) ? cards->front().name : "";
}

int info(const CommonFlags& flags) {
  const auto connection = connect(flags);
  if (!connection) return connection.error();
  auto answer = connection->client->info();
  if (!answer) return print_error(answer.error());
  // Without a server, the command itself slides nodes on CAD files and uses a card.
  if (flags.server.empty()) {
    answer->set_takes_geometries(!find_helper("libvarimesh_opencascade.so", "VARIMESH_OPENCASCADE").empty());
    answer->set_device(first_card());
    answer->set_devices(answer->device().empty() ? 0 : 1);
  }
  const Json entries = document(*answer);
  if (flags.json) {
    print(entries);
    return kDone;
  }
  for (const auto& [key, value] : entries.items()) {
    std::string text = value.is_string() ? value.get<std::string>() : "";
    if (value == "") text = "none";
    if (value.is_array())
      for (const auto& one : value) text += (text.empty() ? "" : ", ") + one.get<std::string>();
    std::cout << fmt::format("{:<27}{}\n", key, text.empty() ? value.dump() : text);
  }
  return kDone;
}

}  // namespace

Action add_info(Command program) {
  auto flags = std::make_shared<CommonFlags>();
  Command command = program.add_command(
      "info", "Show the version, formats, energies and limits of a server; without --server, of this program");
  add_server_flag(command, flags.get());
  add_json_flag(command, flags.get());
  return [flags] { return info(*flags); };
}

}  // namespace varimesh::client
