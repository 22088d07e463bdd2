#include "client/cli/common_flags.h"

#include "core/base/utf8.h"

namespace varimesh::client {

CLI::Option* add_server_flag(CLI::App& command, CommonFlags* flags) {
  command
      .add_option_function<std::string>(
          "--token-file",
          [flags](const std::string& path) {
            flags->credentials.token.clear();
            flags->credentials.token_file = path;
          },
          "File with the token for a server that asks who calls; default: the environment variables VARIMESH_TOKEN "
          "(the "
          "token itself) and VARIMESH_TOKEN_FILE")
      ->type_name("FILE");
  command
      .add_option(
          "--tls-authority", flags->credentials.authority,
          "File with the authority of the server's certificate, in PEM: the connection is encrypted; default: the "
          "environment variable VARIMESH_TLS_AUTHORITY. With an address that begins with https://, the authorities "
          "of this machine need no flag")
      ->type_name("FILE");
  command
      .add_option("--tls-certificate", flags->credentials.certificate,
                  "File with a certificate for a server that asks for one, in PEM; default: VARIMESH_TLS_CERTIFICATE")
      ->type_name("FILE");
  command
      .add_option("--tls-key", flags->credentials.key,
                  "File with the private key of the certificate, in PEM; default: VARIMESH_TLS_KEY")
      ->type_name("FILE");
  return command
      .add_option("--server", flags->server,
                  "Address of a varimeshd: HOST:PORT or unix:PATH; default: the environment variable VARIMESH_SERVER")
      ->type_name("ADDRESS")
      ->envname("VARIMESH_SERVER");
}

void add_json_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("--json", flags->json, "Print one JSON document on standard output and nothing else");
}

void add_quiet_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("-q,--quiet", flags->quiet, "Print no progress and no summary");
}

void add_compress_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("--compress", flags->compress,
                   "Compress meshes on their way to and from the server, for slow networks");
}

void add_history_flag(CLI::App& command, std::string* path) {
  command.add_option("--history", *path, "Write all iterations to this file, as comma-separated values")
      ->type_name("FILE.csv");
}

void add_report_flag(CLI::App& command, std::string* path) {
  command.add_option("--report", *path, "Write an HTML page that shows the mesh, its quality and the convergence")
      ->type_name("FILE.html");
}

void add_request_id_flag(CLI::App& command, std::string* id) {
  command
      .add_option("--request-id", *id,
                  "Join the job that was submitted to the server with the same ID, if there is one")
      ->type_name("ID")
      ->check(is_text());
}

const CLI::Validator& is_text() {
  static const CLI::Validator validator(
      [](std::string& value) {
        return is_utf8(value) ? std::string()
                              : "'" + as_utf8(value) +
                                    "' is not UTF-8 and cannot be sent; a physical group can also be named by its tag.";
      },
      "", "text");
  return validator;
}

}  // namespace varimesh::client
