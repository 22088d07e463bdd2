#include "client/cli/common_flags.h"

namespace varimesh::client {

Flag add_server_flag(Command command, CommonFlags* flags) {
  command
      .add(
          "--token-file",
          [flags](const std::string& path) {
            flags->credentials.token.clear();
            flags->credentials.token_file = path;
          },
          "File with the token for a server that asks who calls; default: the environment variables VARIMESH_TOKEN "
          "(the token itself) and VARIMESH_TOKEN_FILE")
      .value("FILE");
  command
      .add(
          "--tls-authority", &flags->credentials.authority,
          "File with the authority of the server's certificate, in PEM; the connection is then encrypted; default: the "
          "environment variable VARIMESH_TLS_AUTHORITY. An address that begins with https:// needs no flag if this "
          "machine knows the authority")
      .value("FILE");
  command
      .add("--tls-certificate", &flags->credentials.certificate,
           "File with a certificate for a server that asks for one, in PEM; default: VARIMESH_TLS_CERTIFICATE")
      .value("FILE");
  command
      .add("--tls-key", &flags->credentials.key,
           "File with the private key of the certificate, in PEM; default: VARIMESH_TLS_KEY")
      .value("FILE");
  return command
      .add("--server", &flags->server,
           "Address of a varimeshd: HOST:PORT or unix:PATH; default: the environment variable VARIMESH_SERVER")
      .value("ADDRESS")
      .from_environment("VARIMESH_SERVER");
}

void add_json_flag(Command command, CommonFlags* flags) {
  command.add("--json", &flags->json, "Print one JSON document on standard output and nothing else");
}

void add_quiet_flag(Command command, CommonFlags* flags) {
  command.add("-q,--quiet", &flags->quiet, "Print no progress and no summary");
}

void add_compress_flag(Command command, CommonFlags* flags) {
  command.add("--compress", &flags->compress, "Compress meshes on their way to and from the server, for slow networks");
}

void add_history_flag(Command command, std::string* path) {
  command.add("--history", path, "Write all iterations to this file, as comma-separated values")
      .or_standard_output()
      .value("FILE.csv");
}

void add_report_flag(Command command, std::string* path) {
  command.add("--report", path, "Write an HTML page that shows the mesh, its quality and the convergence")
      .or_standard_output()
      .value("FILE.html");
}

void add_keep_orders_flag(Command command, bool* keep_orders) {
  command.add(
      "--keep-orders", keep_orders,
      "If the input has elements of several orders, write each at the order at which it came if that loses nothing");
}

void add_request_id_flag(Command command, std::string* id) {
  command.add("--request-id", id, "Join the job that was submitted to the server with the same ID, if there is one")
      .value("ID")
      .utf8();
}

}  // namespace varimesh::client
