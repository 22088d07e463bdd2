#include "server/webhooks/receivers.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>

#include "server/refusals.h"

namespace varimesh::server {
namespace {

constexpr std::size_t kMostUrlBytes = 2048;
constexpr std::size_t kLeastKeyBytes = 24, kMostKeyBytes = 64;

tl::unexpected<Error> bad_line(std::size_t number, const std::string& what) {
  return bad_option("Line " + std::to_string(number) + " of the file of --webhooks " + what +
                    "; a line is https://HOST[:PORT] KEY, or http[s]://HOST[:PORT] KEY private.");
}

/// The bytes of a key, "whsec_" and base64; empty if it is none.
std::string key_of(std::string_view text) {
  constexpr std::string_view kBegin = "whsec_";
  if (!text.starts_with(kBegin)) return {};
  text.remove_prefix(kBegin.size());
  if (text.empty() || text.size() % 4 != 0 || text.size() > 2 * kMostKeyBytes) return {};
  std::array<unsigned char, 2 * kMostKeyBytes> bytes{};
  const auto* const from = reinterpret_cast<const unsigned char*>(text.data());
  int size = EVP_DecodeBlock(bytes.data(), from, static_cast<int>(text.size()));
  for (; size > 0 && text.ends_with('='); text.remove_suffix(1)) --size;
  const auto count = static_cast<std::size_t>(std::max(size, 0));
  if (count < kLeastKeyBytes || count > kMostKeyBytes) return {};
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)};
}

bool is_letter_of_host(char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '-'; }

bool is_host(std::string_view host) {
  const bool is_v6 = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (is_v6)
    return std::ranges::all_of(host.substr(1, host.size() - 2),
                               [](char c) { return (c >= 'a' && c <= 'f') || (c >= '0' && c <= ':') || c == '.'; });
  return !host.empty() && host.front() != '-' && host.front() != '.' && std::ranges::all_of(host, is_letter_of_host);
}

}  // namespace

std::optional<std::string> origin_of(std::string_view url) {
  if (url.size() > kMostUrlBytes || !std::ranges::all_of(url, [](char c) { return c > ' ' && c <= '~' && c != '\\'; }))
    return std::nullopt;
  const auto colon = url.find("://");
  if (colon == std::string_view::npos) return std::nullopt;
  std::string scheme(url.substr(0, colon));
  std::string authority(url.substr(colon + 3, url.find_first_of("/?#", colon + 3) - colon - 3));
  for (std::string* text : {&scheme, &authority})
    for (char& c : *text)
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  if (scheme != "https" && scheme != "http") return std::nullopt;
  std::string host = authority;
  const auto bracket = authority.rfind(']');
  const auto port = authority.find(':', bracket == std::string::npos ? 0 : bracket);
  if (port != std::string::npos) {
    host = authority.substr(0, port);
    unsigned number = 0;
    const char* const end = authority.data() + authority.size();
    const auto read = std::from_chars(authority.data() + port + 1, end, number);
    if (read.ec != std::errc() || read.ptr != end || number == 0 || number > 65535) return std::nullopt;
    authority = host;
    if (number != (scheme == "https" ? 443U : 80U)) authority += ':' + std::to_string(number);
  }
  if (!is_host(host)) return std::nullopt;
  return scheme + "://" + authority;
}

Expected<Receivers> Receivers::parse(std::string_view text) {
  Receivers receivers;
  std::istringstream lines{std::string(text)};
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line.substr(0, line.find('#')));
    std::string address, key, reach, more;
    if (!(words >> address)) continue;
    words >> key >> reach >> more;
    const auto origin = origin_of(address);
    if (!origin || address.find_first_of("/?#", address.find("://") + 3) != std::string::npos)
      return bad_line(number, "does not begin with an address without a path");
    Receiver receiver{*origin, key_of(key), reach == "private"};
    if (receiver.key.empty())
      return bad_line(number,
                      "has no key: whsec_ and 24 to 64 bytes in base64, such as whsec_$(openssl rand -base64 32)");
    if (!more.empty() || (!reach.empty() && !receiver.may_be_private)) return bad_line(number, "has too many words");
    if (origin->starts_with("http://") && !receiver.may_be_private)
      return bad_line(number, "has an address with http://, which only a private one may have");
    if (receivers.find(*origin) != nullptr) return bad_line(number, "repeats an address of an earlier line");
    receivers.all_.push_back(std::move(receiver));
  }
  return receivers;
}

const Receiver* Receivers::find(std::string_view url) const {
  const auto origin = origin_of(url);
  if (!origin) return nullptr;
  const auto found = std::ranges::find(all_, *origin, &Receiver::origin);
  return found == all_.end() ? nullptr : &*found;
}

Answer<void> check_webhook(std::string_view url, const Receivers* receivers) {
  if (receivers == nullptr)
    return invalid_option(
        "This server calls nobody at the end of a job; leave out the webhook, or ask the operator to start the server "
        "with --webhooks.");
  const auto origin = origin_of(url);
  if (!origin)
    return invalid_option("The webhook must be an address such as https://ci.example.org/jobs, with at most " +
                          std::to_string(kMostUrlBytes) + " bytes.");
  if (receivers->find(url) == nullptr)
    return invalid_option("This server may not call " + *origin +
                          " at the end of a job; ask its operator to add it to the file of --webhooks.");
  return {};
}

std::string webhook_signature(std::string_view key, std::string_view id, std::string_view time, std::string_view body) {
  std::string text(id);
  ((text += '.') += time) += '.';
  text += body;
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), reinterpret_cast<const unsigned char*>(text.data()),
       text.size(), digest.data(), &size);
  std::array<unsigned char, 2 * EVP_MAX_MD_SIZE> encoded{};
  EVP_EncodeBlock(encoded.data(), digest.data(), static_cast<int>(size));
  return "v1," + std::string(reinterpret_cast<const char*>(encoded.data()));
}

}  // namespace varimesh::server
