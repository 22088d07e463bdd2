// Puts together what is signed from the parts of the request, not from the bytes that the client has signed.
#include "tests/server/meshes/s3/signature.h"

#include <openssl/hmac.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

#include "core/base/sha256.h"
#include "server/meshes/s3/client.h"

namespace varimesh::server::testing {
namespace {

std::string hmac(const std::string& key, const std::string& text) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), reinterpret_cast<const unsigned char*>(text.data()),
       text.size(), digest, &size);
  return {reinterpret_cast<const char*>(digest), size};
}

std::string hexadecimal(const std::string& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const char byte : bytes) (text += kDigits[(byte >> 4) & 15]) += kDigits[byte & 15];
  return text;
}

std::string decoded(const std::string& text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '%' && i + 2 < text.size()) {
      plain += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      plain += text[i];
    }
  return plain;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream from(text);
  for (std::string part; std::getline(from, part, at);) parts.push_back(part);
  return parts;
}

std::string canonical_path(const std::string& path) {
  std::string canonical;
  for (const std::string& part : split(path.substr(1), '/')) canonical += '/' + percent_encoded(decoded(part));
  return path.ends_with('/') ? canonical + '/' : canonical;
}

std::string canonical_query(const std::string& query) {
  std::vector<std::pair<std::string, std::string>> all;
  for (const std::string& word : split(query, '&')) {
    const auto equals = word.find('=');
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    all.emplace_back(percent_encoded(decoded(word.substr(0, equals))), percent_encoded(decoded(value)));
  }
  std::ranges::sort(all);
  std::string canonical;
  for (const auto& [key, value] : all) canonical += (canonical.empty() ? "" : "&") + key + "=" + value;
  return canonical;
}

/// The text behind `name` up to a comma or the end.
std::string field(const std::string& text, const std::string& name) {
  const auto begin = text.find(name + "=");
  if (begin == std::string::npos) return {};
  const auto from = begin + name.size() + 1;
  return text.substr(from, text.find(',', from) - from);
}

}  // namespace

bool is_signed(std::string_view head, const std::string& secret) {
  std::istringstream lines{std::string(head)};
  std::string method, target, line;
  lines >> method >> target;
  std::getline(lines, line);
  std::map<std::string, std::string> headers;
  while (std::getline(lines, line) && line != "\r") {
    const auto colon = line.find(':');
    if (colon == std::string::npos) return false;
    std::string name = line.substr(0, colon);
    std::ranges::transform(name, name.begin(), [](char letter) {
      return letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter + 32) : letter;
    });
    const auto first = line.find_first_not_of(' ', colon + 1), last = line.find_last_not_of(" \r");
    headers[name] = first == std::string::npos || first > last ? "" : line.substr(first, last - first + 1);
  }
  const std::string given = headers["authorization"];
  const std::vector<std::string> scope = split(field(given, "Credential"), '/');
  if (scope.size() != 5) return false;
  const std::string names = field(given, "SignedHeaders");
  std::string canonical = method + "\n" + canonical_path(target.substr(0, target.find('?'))) + "\n";
  canonical +=
      (target.find('?') == std::string::npos ? "" : canonical_query(target.substr(target.find('?') + 1))) + "\n";
  for (const std::string& name : split(names, ';')) canonical += name + ":" + headers[name] + "\n";
  canonical += "\n" + names + "\n" + headers["x-amz-content-sha256"];
  const std::string where = scope[1] + "/" + scope[2] + "/" + scope[3] + "/" + scope[4];
  const std::string text = "AWS4-HMAC-SHA256\n" + headers["x-amz-date"] + "\n" + where + "\n" + sha256(canonical);
  const std::string key = hmac(hmac(hmac(hmac("AWS4" + secret, scope[1]), scope[2]), scope[3]), scope[4]);
  // What is not signed could be changed on the way.
  const bool signs_all =
      names.find("host") != std::string::npos && names.find("x-amz-content-sha256") != std::string::npos;
  return signs_all && field(given, "Signature") == hexadecimal(hmac(key, text));
}

}  // namespace varimesh::server::testing
