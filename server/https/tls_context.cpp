#include "server/https/tls_context.h"

#include <openssl/err.h>
#include <openssl/x509v3.h>

#include <string_view>

namespace varimesh::server {
namespace {

/// Nobody can type the password of a key into a server.
int no_password(char*, int, int, void*) { return 0; }

/// Browsers and curl would like HTTP/2, which this port does not speak.
int choose_protocol(SSL*, const unsigned char** chosen, unsigned char* size, const unsigned char* offered,
                    unsigned int count, void*) {
  constexpr std::string_view kHttp = "http/1.1";
  for (unsigned int at = 0; at < count; at += 1U + offered[at]) {
    const std::string_view name(reinterpret_cast<const char*>(offered) + at + 1, offered[at]);
    if (name != kHttp) continue;
    *chosen = offered + at + 1;
    *size = offered[at];
    return SSL_TLSEXT_ERR_OK;
  }
  return SSL_TLSEXT_ERR_NOACK;
}

/// Asks clients for certificates of this authority.
bool ask_clients(SSL_CTX& context, const std::string& authority) {
  STACK_OF(X509_NAME)* const names = SSL_load_client_CA_file(authority.c_str());
  if (names == nullptr) return false;
  SSL_CTX_set_client_CA_list(&context, names);
  SSL_CTX_set_verify(&context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  return SSL_CTX_load_verify_locations(&context, authority.c_str(), nullptr) == 1;
}

/// The file that this flag names cannot be used. The file itself may be a copy without a name.
tl::unexpected<Error> unusable_file(const char* flag) {
  const char* const words = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  return bad_option(std::string("The file of ") + flag +
                    " cannot be used for --https: " + (words == nullptr ? "OpenSSL does not say why" : words) + ".");
}

}  // namespace

Expected<TlsContext> tls_context(const TlsFiles& files) {
  ERR_clear_error();
  const TlsContext context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (context == nullptr) return unusable_file("--tls-certificate");
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_options(context.get(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(context.get(),
                   SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_default_passwd_cb(context.get(), no_password);
  SSL_CTX_set_alpn_select_cb(context.get(), choose_protocol, nullptr);
  constexpr unsigned char kSessions[] = "varimesh https";
  SSL_CTX_set_session_id_context(context.get(), kSessions, sizeof kSessions - 1);
  if (SSL_CTX_use_certificate_chain_file(context.get(), files.certificate.c_str()) != 1)
    return unusable_file("--tls-certificate");
  if (SSL_CTX_use_PrivateKey_file(context.get(), files.key.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context.get()) != 1)
    return unusable_file("--tls-key");
  if (files.are_mutual() && !ask_clients(*context, files.authority)) return unusable_file("--tls-authority");
  ERR_clear_error();
  return context;
}

bool is_named(SSL_CTX& context, const std::string& host) {
  X509* const certificate = SSL_CTX_get0_certificate(&context);
  if (certificate == nullptr || host.empty()) return false;
  const bool has_brackets = host.front() == '[' && host.back() == ']';
  const std::string address = has_brackets ? host.substr(1, host.size() - 2) : host;
  return X509_check_ip_asc(certificate, address.c_str(), 0) == 1 ||
         (!has_brackets && X509_check_host(certificate, host.data(), host.size(), 0, nullptr) == 1);
}

std::string name_of_client(const SSL& connection) {
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(SSL_get1_peer_certificate(&connection), X509_free);
  if (certificate == nullptr) return {};
  const X509_NAME* const subject = X509_get_subject_name(certificate.get());
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  if (at < 0) return {};
  unsigned char* text = nullptr;
  const int size = ASN1_STRING_to_UTF8(&text, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  ERR_clear_error();  // what follows on this thread must not take the error for its own
  if (size < 0) return {};
  std::string name(reinterpret_cast<const char*>(text), static_cast<std::size_t>(size));
  OPENSSL_free(text);
  return name;
}

}  // namespace varimesh::server
