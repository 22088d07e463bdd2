// Parses addresses and files of credentials.
#include "server/meshes/s3/address.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <string_view>

namespace varimesh::server {
namespace {

constexpr std::string_view kScheme = "s3://";

tl::unexpected<Error> refuse(const std::string& why) {
  return tl::unexpected(Error{Error::Kind::BadOption, "The address of --meshes cannot be used: " + why +
                                                          "; write s3://BUCKET/PREFIX?endpoint=https://HOST&region="
                                                          "NAME."});
}

/// Whether all letters are digits, letters of English or in `others`: such a text stands in a URL as it is.
bool is_plain(std::string_view text, std::string_view others) {
  return std::ranges::all_of(text, [&](unsigned char letter) {
    return (letter < 128 && std::isalnum(letter) != 0) || others.find(static_cast<char>(letter)) != std::string::npos;
  });
}

bool is_endpoint(std::string_view url) {
  for (const std::string_view scheme : {"http://", "https://"})
    if (url.starts_with(scheme)) {
      const std::string_view host = url.substr(scheme.size());
      return !host.empty() && is_plain(host, ".-:[]");
    }
  return false;
}

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

/// Reads a profile of a file as Amazon's tools write it. What is missing stays empty.
S3Credentials read_profile(const std::string& path, const std::string& profile) {
  S3Credentials credentials;
  bool is_inside = false;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const std::string text = trimmed(line);
    if (text.starts_with('[')) is_inside = text == "[" + profile + "]";
    const auto equals = text.find('=');
    if (!is_inside || equals == std::string::npos) continue;
    const std::string key = trimmed(text.substr(0, equals)), value = trimmed(text.substr(equals + 1));
    if (key == "aws_access_key_id") credentials.key_id = value;
    if (key == "aws_secret_access_key") credentials.secret = value;
    if (key == "aws_session_token") credentials.token = value;
  }
  return credentials;
}

}  // namespace

bool is_s3(const std::string& address) { return address.starts_with(kScheme); }

Expected<S3Address> parse_s3_address(const std::string& address) {
  if (!is_s3(address)) return refuse("it does not begin with s3://");
  const auto question = address.find('?');
  const std::string path = address.substr(kScheme.size(), question - kScheme.size());
  S3Address parsed;
  const auto slash = path.find('/');
  parsed.bucket = path.substr(0, slash);
  if (slash != std::string::npos) parsed.prefix = path.substr(slash + 1);
  while (parsed.prefix.ends_with('/')) parsed.prefix.pop_back();
  if (!parsed.prefix.empty()) parsed.prefix += '/';
  if (path.find('@') != std::string::npos || path.find(':') != std::string::npos)
    return refuse("it has credentials in it, which every user of this machine can read in the list of processes");
  if (parsed.bucket.empty() || !is_plain(parsed.bucket, ".-_")) return refuse("it names no bucket");
  if (!is_plain(parsed.prefix, "/._-") || parsed.prefix.starts_with('/') ||
      ("/" + parsed.prefix).find("//") != std::string::npos ||
      ("/" + parsed.prefix).find("/../") != std::string::npos || ("/" + parsed.prefix).find("/./") != std::string::npos)
    return refuse("its prefix may have letters of English, digits, and the signs / . _ -");
  for (std::string rest = question == std::string::npos ? "" : address.substr(question + 1); !rest.empty();) {
    const auto end = rest.find('&');
    const std::string word = rest.substr(0, end);
    rest = end == std::string::npos ? "" : rest.substr(end + 1);
    const auto equals = word.find('=');
    const std::string key = word.substr(0, equals), value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (key == "endpoint" && is_endpoint(value))
      parsed.endpoint = value;
    else if (key == "region" && !value.empty() && is_plain(value, "-"))
      parsed.region = value;
    else if (key == "endpoint")
      return refuse("its endpoint must be http://HOST:PORT or https://HOST:PORT");
    else
      return refuse("behind the question mark it may have endpoint=URL and region=NAME");
  }
  if (parsed.endpoint.empty()) parsed.endpoint = "https://s3." + parsed.region + ".amazonaws.com";
  return parsed;
}

Expected<S3Credentials> read_s3_credentials() {
  S3Credentials credentials{environment("AWS_ACCESS_KEY_ID"), environment("AWS_SECRET_ACCESS_KEY"),
                            environment("AWS_SESSION_TOKEN")};
  if (!credentials.key_id.empty() && !credentials.secret.empty()) return credentials;
  std::string path = environment("AWS_SHARED_CREDENTIALS_FILE");
  if (path.empty()) path = environment("HOME") + "/.aws/credentials";
  const std::string profile = environment("AWS_PROFILE");
  credentials = read_profile(path, profile.empty() ? "default" : profile);
  if (!credentials.key_id.empty() && !credentials.secret.empty()) return credentials;
  return tl::unexpected(Error{
      Error::Kind::BadOption,
      "There are no credentials for the bucket of --meshes; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or name "
      "a file with them in AWS_SHARED_CREDENTIALS_FILE."});
}

}  // namespace varimesh::server
