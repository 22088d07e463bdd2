#include "client/tls/certificates.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <memory>

#include "core/base/io/write_all.h"

namespace varimesh::client {
namespace {

struct Freer {
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
  void operator()(BIO* file) const { BIO_free_all(file); }
};
template <class T>
using Owned = std::unique_ptr<T, Freer>;

/// A certificate and its private key.
struct Identity {
  Owned<X509> certificate;
  Owned<EVP_PKEY> key;
};

tl::unexpected<Error> openssl_failed(const std::string& what) {
  return tl::unexpected(Error{Error::Kind::Internal, what + " could not be made by OpenSSL; please report it."});
}

bool is_file_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && name.front() != '.' && name != "server" && name != "authority" &&
         !name.ends_with("-key") && std::ranges::all_of(name, [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-' || c == '@';
         });
}

bool is_ip_address(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 || inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

bool is_host(const std::string& host) {
  if (is_ip_address(host)) return true;
  return !host.empty() && host.size() <= 253 && std::ranges::all_of(host, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '*';
  });
}

// ===== certificates =====

bool add_extension(X509* certificate, X509* issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  return extension != nullptr && X509_add_ext(certificate, extension.get(), -1) == 1;
}

/// Sets a random serial number of 127 bits.
bool set_serial(X509* certificate) {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) return false;
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x7F) | 0x40);
  BIGNUM* number = BN_bin2bn(bytes.data(), static_cast<int>(bytes.size()), nullptr);
  const bool set = number != nullptr && BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate)) != nullptr;
  BN_free(number);
  return set;
}

/// What makes a certificate one of an authority, a server or a client. Certificates of servers and clients also name
/// the key that has signed them, as RFC 5280 (section 4.2.1.1) demands. Python 3.13 refuses certificates that do not.
using Extensions = std::vector<std::pair<int, std::string>>;

/// Returns a new key with a certificate, which the issuer signs; without an issuer the key itself does.
Expected<Identity> make_identity(const std::string& name, const Extensions& extensions, int days,
                                 const Identity* issuer) {
  constexpr long kDay = 24L * 60 * 60, kHour = 60L * 60;
  Identity made{Owned<X509>(X509_new()), Owned<EVP_PKEY>(EVP_EC_gen("P-256"))};
  X509* certificate = made.certificate.get();
  if (certificate == nullptr || made.key == nullptr) return openssl_failed("A key");
  const bool begun = X509_set_version(certificate, X509_VERSION_3) == 1 && set_serial(certificate) &&
                     // Other machines' clocks may be behind.
                     X509_gmtime_adj(X509_getm_notBefore(certificate), days > 0 ? -kHour : -2 * kDay) != nullptr &&
                     X509_gmtime_adj(X509_getm_notAfter(certificate), days > 0 ? days * kDay : -kDay) != nullptr &&
                     X509_set_pubkey(certificate, made.key.get()) == 1;
  X509_NAME* subject = X509_get_subject_name(certificate);
  const bool named =
      begun && X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8,
                                          reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0) == 1;
  X509* signer = issuer == nullptr ? certificate : issuer->certificate.get();
  bool good = named && X509_set_issuer_name(certificate, X509_get_subject_name(signer)) == 1;
  for (const auto& [kind, value] : extensions) good = good && add_extension(certificate, signer, kind, value);
  good = good && X509_sign(certificate, issuer == nullptr ? made.key.get() : issuer->key.get(), EVP_sha256()) > 0;
  if (!good) return openssl_failed("A certificate for " + name);
  return made;
}

Expected<Identity> make_authority() {
  constexpr int kTenYears = 3650;
  return make_identity("VariMesh test authority",
                       {{NID_basic_constraints, "critical,CA:TRUE,pathlen:0"},
                        {NID_key_usage, "critical,keyCertSign,cRLSign"},
                        {NID_subject_key_identifier, "hash"}},
                       kTenYears, nullptr);
}

Expected<Identity> make_server(const CertificateOrder& order, const Identity& authority) {
  std::string names;
  for (const std::string& host : order.hosts)
    names += (names.empty() ? "" : ",") + std::string(is_ip_address(host) ? "IP:" : "DNS:") + host;
  return make_identity("VariMesh server",
                       {{NID_basic_constraints, "critical,CA:FALSE"},
                        {NID_key_usage, "critical,digitalSignature"},
                        {NID_ext_key_usage, "serverAuth"},
                        {NID_authority_key_identifier, "keyid:always"},
                        {NID_subject_alt_name, names}},
                       order.days, &authority);
}

Expected<Identity> make_client(const std::string& name, int days, const Identity& authority) {
  return make_identity(name,
                       {{NID_basic_constraints, "critical,CA:FALSE"},
                        {NID_key_usage, "critical,digitalSignature"},
                        {NID_ext_key_usage, "clientAuth"},
                        {NID_authority_key_identifier, "keyid:always"}},
                       days, &authority);
}

// ===== files =====

std::string text_of(BIO* memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  return std::string(data, static_cast<std::size_t>(size));
}

/// Replaces a file as a whole.
Expected<void> write(const std::filesystem::path& path, const std::string& text, mode_t mode) {
  const std::string beside = path.string() + ".new";
  ::unlink(beside.c_str());
  const int file = ::open(beside.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, mode);
  const bool written = file >= 0 && write_all(file, text);
  const int reason = errno;
  if (file >= 0) ::close(file);
  if (written && ::rename(beside.c_str(), path.c_str()) == 0) return {};
  return tl::unexpected(Error{Error::Kind::Output, "'" + path.string() + "' cannot be written (" +
                                                       std::strerror(written ? errno : reason) +
                                                       "); name a folder in which you may write."});
}

/// Writes NAME.pem and NAME-key.pem.
Expected<void> write(const std::filesystem::path& folder, const std::string& name, const Identity& identity) {
  const Owned<BIO> certificate(BIO_new(BIO_s_mem())), key(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_X509(certificate.get(), identity.certificate.get()) != 1 ||
      PEM_write_bio_PKCS8PrivateKey(key.get(), identity.key.get(), nullptr, nullptr, 0, nullptr, nullptr) != 1)
    return openssl_failed("The text of a certificate");
  if (const auto written = write(folder / (name + "-key.pem"), text_of(key.get()), 0600); !written) return written;
  return write(folder / (name + ".pem"), text_of(certificate.get()), 0644);
}

/// Reads the authority of a folder; nothing if it has none.
Expected<Identity> read_authority(const std::filesystem::path& folder) {
  const Owned<BIO> certificate(BIO_new_file((folder / "authority.pem").c_str(), "r"));
  const Owned<BIO> key(BIO_new_file((folder / "authority-key.pem").c_str(), "r"));
  const auto no_password = [](char*, int, int, void*) { return 0; };
  Identity identity;
  if (certificate != nullptr)
    identity.certificate.reset(PEM_read_bio_X509(certificate.get(), nullptr, no_password, nullptr));
  if (key != nullptr) identity.key.reset(PEM_read_bio_PrivateKey(key.get(), nullptr, no_password, nullptr));
  if (identity.certificate == nullptr || identity.key == nullptr ||
      X509_check_private_key(identity.certificate.get(), identity.key.get()) != 1)
    return bad_input("The authority in '" + folder.string() +
                     "' (authority.pem, authority-key.pem) cannot be used; name another folder.");
  return identity;
}

Expected<void> check(const CertificateOrder& order) {
  for (const std::string& host : order.hosts)
    if (!is_host(host)) return bad_option("'" + host + "' is neither a host name nor an IP address.");
  for (const std::string& name : order.clients)
    if (!is_file_name(name))
      return bad_option("'" + name +
                        "' cannot be the name of a client: it has letters, digits and . _ - @, and is not "
                        "server, authority or NAME-key.");
  return {};
}

}  // namespace

Expected<std::vector<std::string>> make_certificates(const CertificateOrder& order) {
  if (const auto checked = check(order); !checked) return tl::unexpected(checked.error());
  std::error_code error;
  std::filesystem::create_directories(order.folder, error);
  std::vector<std::string> names;
  const auto keep = [&](const std::string& name, const Expected<Identity>& identity) -> Expected<void> {
    if (!identity) return tl::unexpected(identity.error());
    names.insert(names.end(), {name + ".pem", name + "-key.pem"});
    return write(order.folder, name, *identity);
  };
  const bool has_authority = std::filesystem::exists(order.folder / "authority.pem", error);
  const auto authority = has_authority ? read_authority(order.folder) : make_authority();
  if (!authority) return tl::unexpected(authority.error());
  if (!has_authority)
    if (const auto kept = keep("authority", authority); !kept) return tl::unexpected(kept.error());
  // A running server reads its files again: a certificate for other hosts would break its clients.
  if (!order.keep_server || !std::filesystem::exists(order.folder / "server.pem", error))
    if (const auto kept = keep("server", make_server(order, *authority)); !kept) return tl::unexpected(kept.error());
  for (const std::string& name : order.clients)
    if (const auto kept = keep(name, make_client(name, order.days, *authority)); !kept)
      return tl::unexpected(kept.error());
  return names;
}

}  // namespace varimesh::client
