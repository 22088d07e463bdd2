#include "client/library/authorisation.h"

#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include "client/library/failures.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kMostTokenBytes = 4096, kMostTraceBytes = 256;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::string trimmed(const std::string& text) {
  constexpr const char* space = " \t\r\n";
  const auto first = text.find_first_not_of(space);
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(space) - first + 1);
}

/// Returns the content of a file; nothing if it cannot be read.
std::optional<std::string> text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (file) text << file.rdbuf();
  return file ? std::optional(text.str()) : std::nullopt;
}

/// gRPC ends the process if a header has other bytes than these.
bool is_header(const std::string& token) {
  for (const char c : token)
    if (c <= ' ' || c > '~') return false;
  return true;
}

}  // namespace

Credentials credentials_from_environment() {
  Credentials credentials;
  credentials.token = variable("VARIMESH_TOKEN");
  credentials.token_file = variable("VARIMESH_TOKEN_FILE");
  credentials.authority = variable("VARIMESH_TLS_AUTHORITY");
  credentials.certificate = variable("VARIMESH_TLS_CERTIFICATE");
  credentials.key = variable("VARIMESH_TLS_KEY");
  return credentials;
}

Outcome<std::string> token_of(const Credentials& credentials) {
  std::string token = trimmed(credentials.token);
  const std::string& path = credentials.token_file;
  if (token.empty() && !path.empty()) {
    token = trimmed(text_of(path).value_or(""));
    if (token.empty())
      return file_failure("The file of the token '" + path + "' cannot be read or is empty; name a file with a token.");
  }
  if (token.size() > kMostTokenBytes || !is_header(token))
    return file_failure("The token " + (path.empty() ? "" : "in '" + path + "' ") +
                        "is not one line of letters, digits and signs; check where it comes from.");
  return token;
}

Outcome<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const Credentials& credentials, bool encrypted) {
  if (!encrypted && credentials.authority.empty() && credentials.certificate.empty() && credentials.key.empty())
    return grpc::InsecureChannelCredentials();
  if (credentials.certificate.empty() != credentials.key.empty())
    return file_failure("A certificate and its key belong together; give both (--tls-certificate and --tls-key).");
  grpc::SslCredentialsOptions options;
  for (const auto& [path, text] : {std::pair{&credentials.authority, &options.pem_root_certs},
                                   std::pair{&credentials.certificate, &options.pem_cert_chain},
                                   std::pair{&credentials.key, &options.pem_private_key}}) {
    if (path->empty()) continue;
    auto read = text_of(*path);
    if (!read || read->find("-----BEGIN ") == std::string::npos)
      return file_failure("The file '" + *path +
                          "' cannot be read or has nothing in PEM; name a file with a certificate "
                          "or a key.");
    *text = std::move(*read);
  }
  return grpc::SslCredentials(options);
}

void authorise(const Settings& settings, grpc::ClientContext* call) {
  if (!settings.credentials.token.empty()) call->AddMetadata("authorization", "Bearer " + settings.credentials.token);
  // The calls are part of the trace of the program that has started this one, if it says so.
  const std::string parent = variable("TRACEPARENT");
  if (!parent.empty() && parent.size() <= kMostTraceBytes && is_header(parent))
    call->AddMetadata("traceparent", parent);
}

}  // namespace varimesh::client
