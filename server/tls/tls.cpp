// Checks the files with OpenSSL, and leaves the rest to gRPC.
#include "server/tls/tls.h"

#include <fcntl.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "server/tls/private_file.h"

namespace varimesh::server {
namespace {

/// How often gRPC looks whether the files have changed, in seconds.
constexpr unsigned kRefreshSeconds = 2;

struct Freer {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(BIO* file) const { BIO_free_all(file); }
  void operator()(X509* certificate) const { X509_free(certificate); }
};
template <class T>
using Owned = std::unique_ptr<T, Freer>;

/// The newest error of OpenSSL, in words.
std::string reason() {
  std::array<char, 256> text{};
  const unsigned long code = ERR_peek_last_error();
  ERR_error_string_n(code, text.data(), text.size());
  ERR_clear_error();
  const char* words = ERR_reason_error_string(code);
  return words != nullptr ? words : text.data();
}

/// Nobody can type the password of a key into a server.
int no_password(char*, int, int, void*) { return 0; }

/// `bytes`: the file that has the bytes of `file`.
Expected<void> check_time(const std::string& file, const std::string& bytes) {
  const Owned<BIO> opened(BIO_new_file(bytes.c_str(), "r"));
  const Owned<X509> certificate(opened == nullptr ? nullptr
                                                  : PEM_read_bio_X509(opened.get(), nullptr, no_password, nullptr));
  if (certificate == nullptr) return unusable("--tls-certificate", file, reason());
  if (X509_cmp_current_time(X509_get0_notAfter(certificate.get())) < 0)
    return unusable("--tls-certificate", file, "the certificate has expired; make or ask for a new one");
  return {};
}

}  // namespace

Expected<void> check_tls_files(const TlsFiles& files, const TlsFiles* copies) {
  if (!files.are_given()) return {};
  if (files.certificate.empty() || files.key.empty())
    return bad_option("TLS needs both --tls-certificate and --tls-key; 'varimesh certificates' makes files to try it.");
  if (auto checked = check_file_is_private("--tls-key", files.key); !checked) return checked;
  if (files.are_mutual())
    if (auto checked = check_nobody_else_writes("--tls-authority", files.authority); !checked) return checked;
  const TlsFiles& bytes = copies == nullptr ? files : *copies;
  const Owned<SSL_CTX> context(SSL_CTX_new(TLS_server_method()));
  if (context == nullptr) return unusable("--tls-certificate", files.certificate, reason());
  SSL_CTX_set_default_passwd_cb(context.get(), no_password);
  if (SSL_CTX_use_certificate_chain_file(context.get(), bytes.certificate.c_str()) != 1)
    return unusable("--tls-certificate", files.certificate, reason());
  if (SSL_CTX_use_PrivateKey_file(context.get(), bytes.key.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context.get()) != 1)
    return unusable("--tls-key", files.key, reason());
  if (files.are_mutual() && SSL_CTX_load_verify_locations(context.get(), bytes.authority.c_str(), nullptr) != 1)
    return unusable("--tls-authority", files.authority, reason());
  return check_time(files.certificate, bytes.certificate);
}

std::shared_ptr<grpc::ServerCredentials> server_credentials(const TlsFiles& files) {
  if (!files.are_given()) return grpc::InsecureServerCredentials();
  using grpc::experimental::FileWatcherCertificateProvider;
  grpc::experimental::TlsServerCredentialsOptions options(
      files.are_mutual()
          ? std::make_shared<FileWatcherCertificateProvider>(files.key, files.certificate, files.authority,
                                                             kRefreshSeconds)
          : std::make_shared<FileWatcherCertificateProvider>(files.key, files.certificate, kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  if (files.are_mutual()) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

bool speaks_tls(const std::string& address, std::chrono::milliseconds patience) {
  const Owned<SSL_CTX> context(SSL_CTX_new(TLS_client_method()));
  if (context == nullptr) return false;
  SSL_CTX_set_verify(context.get(), SSL_VERIFY_NONE, nullptr);
  const unsigned char protocols[] = {2, 'h', '2'};
  SSL_CTX_set_alpn_protos(context.get(), protocols, sizeof protocols);
  const Owned<BIO> connection(BIO_new_ssl_connect(context.get()));
  if (connection == nullptr) return false;
  BIO_set_conn_hostname(connection.get(), address.c_str());
  BIO_set_nbio(connection.get(), 1);
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (BIO_do_handshake(connection.get()) != 1) {
    // Without a certificate the handshake may fail in the end; then the server has spoken.
    SSL* ssl = nullptr;
    BIO_get_ssl(connection.get(), &ssl);
    const auto state = ssl == nullptr ? TLS_ST_BEFORE : SSL_get_state(ssl);
    if (state != TLS_ST_BEFORE && state != TLS_ST_CW_CLNT_HELLO) break;
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (!BIO_should_retry(connection.get()) || left.count() <= 0) {
      ERR_clear_error();
      return false;
    }
    BIO_wait(connection.get(), time(nullptr) + 1, 20);
  }
  ERR_clear_error();
  return true;
}

}  // namespace varimesh::server
