// varimesh certificates: makes certificates for a server and its clients.
#include "client/tls/certificates.h"

#include <unistd.h>

#include <array>
#include <iostream>

#include "client/commands/commands.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

/// The names by which this machine reaches itself, and its own.
std::vector<std::string> names_of_this_machine() {
  std::vector<std::string> names{"localhost", "127.0.0.1", "::1"};
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) == 0 && name[0] != '\0' && std::string(name.data()) != "localhost")
    names.emplace_back(name.data());
  return names;
}

int make(CertificateOrder order) {
  order.keep_server = order.hosts.empty() && !order.clients.empty();
  if (order.hosts.empty()) order.hosts = names_of_this_machine();
  if (order.clients.empty()) order.clients = {"client"};
  const auto made = make_certificates(order);
  if (!made) return print_error(made.error());
  for (const std::string& name : *made) std::cout << (order.folder / name).string() << std::endl;
  return kDone;
}

}  // namespace

Action add_certificates(Command program) {
  auto order = std::make_shared<CertificateOrder>();
  Command command =
      program.add_command("certificates", "Make an authority, and certificates for a server and its clients");
  command
      .add("DIR", &order->folder,
           "The folder for the files; if it has an authority already, this authority is used again")
      .required()
      .value("DIR");
  command
      .add("--host", &order->hosts,
           "A name or an IP address of the server; may be repeated; default: localhost, 127.0.0.1, ::1 and the name "
           "of this machine. With --client and without --host, a certificate of the server that is in DIR stays")
      .value("HOST")
      .one_value_each();
  command
      .add("--client", &order->clients,
           "The name of a client, which owns the jobs that it submits; may be repeated; default: client")
      .value("NAME")
      .one_value_each();
  command
      .add("--days", &order->days,
           "For how many days the certificates are valid (365); 0: they have expired, for tests")
      .value("N")
      .from(0, 36500);
  return [order] { return make(*order); };
}

}  // namespace varimesh::client
