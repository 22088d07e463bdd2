// Reads the file of tokens, and compares tokens with it.
#include "server/access/access.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <utility>

#include "server/log/log.h"
#include "server/meshes/read_at.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

constexpr std::int64_t kMostFileBytes = std::int64_t{16} << 20;

/// Returns the token of "Bearer TOKEN"; empty if there is none.
std::string_view token_of(std::string_view authorization) {
  constexpr std::string_view scheme = "bearer ";
  if (authorization.size() <= scheme.size()) return {};
  for (std::size_t i = 0; i < scheme.size(); ++i)
    if (std::tolower(static_cast<unsigned char>(authorization[i])) != scheme[i]) return {};
  return authorization.substr(scheme.size());
}

tl::unexpected<Error> unusable(const std::string& file, const std::string& why) {
  return bad_option("The file of tokens or keys '" + file + "' cannot be used: " + why + ".");
}

/// Whether keys can be fetched with these settings, whatever their server answers.
Expected<void> check_fetched(const JsonWebTokenSettings& settings) {
  if (!JsonWebTokens::available()) return tl::unexpected(JsonWebTokens::parse(settings, {}).error());
  if (settings.issuer.empty() || settings.audience.empty())
    return bad_option("JSON Web Tokens need --jwt-issuer and --jwt-audience.");
  if (!settings.fetch) return bad_option("This build cannot fetch the keys of an issuer; name a file with --jwt-keys.");
  return {};
}

/// Closes a descriptor at the end of a block.
struct Closing {
  int file;
  ~Closing() {
    if (file >= 0) ::close(file);
  }
};

}  // namespace

Expected<std::unique_ptr<Access>> Access::with_tokens(const std::string& file, std::function<WallTime()> clock) {
  auto loaded = load(file);
  if (!loaded) return tl::unexpected(loaded.error());
  auto access = std::make_unique<Access>();
  access->file_ = file;
  access->clock_ = std::move(clock);
  access->tokens_ = std::make_shared<const Tokens>(std::move(loaded->tokens));
  access->version_ = loaded->version;
  return access;
}

Expected<std::unique_ptr<Access>> Access::with_tokens(const std::string& file, const JsonWebTokenSettings& web_tokens,
                                                      std::function<WallTime()> clock) {
  auto access = file.empty() ? std::make_unique<Access>() : nullptr;
  if (access == nullptr) {
    auto opened = with_tokens(file, clock);
    if (!opened) return opened;
    access = std::move(*opened);
  }
  access->clock_ = std::move(clock);
  if (!web_tokens.are_given()) return access;
  access->web_token_settings_ = web_tokens;
  if (web_tokens.are_fetched()) {
    if (const auto checked = check_fetched(web_tokens); !checked) return tl::unexpected(checked.error());
    access->issuer_keys_ = std::make_unique<IssuerKeys>(web_tokens);
    if (const auto fetched = access->issuer_keys_->refresh(); !fetched) access->failed_at_start_ = fetched.error();
    return access;
  }
  auto text = web_tokens.keys.empty() ? Text() : read(web_tokens.keys);
  if (!text) return tl::unexpected(text.error());
  auto keys = JsonWebTokens::parse(web_tokens, text->text);
  if (!keys) return tl::unexpected(keys.error());
  access->web_tokens_ = std::move(*keys);
  access->keys_version_ = text->version;
  return access;
}

std::unique_ptr<Access> Access::with_certificates() {
  auto access = std::make_unique<Access>();
  access->names_certificates_ = true;
  return access;
}

Expected<Access::Text> Access::read(const std::string& file) {
  const Closing opened{::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat status {};
  if (opened.file < 0 || ::fstat(opened.file, &status) != 0) return unusable(file, std::strerror(errno));
  if (!S_ISREG(status.st_mode)) return unusable(file, "it is not a file");
  if (status.st_uid != ::geteuid() && status.st_uid != 0)
    return unusable(file, "it belongs to another user (uid " + std::to_string(status.st_uid) + ")");
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return unusable(file, "other users can write it; run chmod go-w on it");
  if (status.st_size > kMostFileBytes) return unusable(file, "it has more than 16 MiB");
  std::string text;
  if (!read_at(opened.file, 0, static_cast<std::size_t>(status.st_size), &text))
    return unusable(file, std::strerror(errno));
  const Version version{status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec, status.st_size, status.st_ino};
  return Text{std::move(text), version};
}

Expected<Access::Loaded> Access::load(const std::string& file) {
  auto read_text = read(file);
  if (!read_text) return tl::unexpected(read_text.error());
  auto tokens = Tokens::parse(read_text->text);
  if (!tokens) return tl::unexpected(tokens.error());
  return Loaded{std::move(*tokens), read_text->version};
}

Expected<Access::Version> Access::version_of(const std::string& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return unusable(file, std::strerror(errno));
  return Version{status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec, status.st_size, status.st_ino};
}

Answer<Caller> Access::admit(Method method, std::string_view authorization, const std::string& address,
                             const std::string& certificate) const {
  auto caller = find(method, authorization, address, certificate);
  if (caller) {
    caller->address = address;
  } else if (refusals_.take(caller.error().reason)) {
    const auto named = caller.error().metadata.find("caller");
    const std::string owner = named == caller.error().metadata.end() ? certificate : named->second;
    audit("refused", std::string(rule_of(method).name), caller.error().reason, {.owner = owner, .address = address});
  }
  return caller;
}

void Access::note_left_out() {
  for (const auto& [reason, count] : refusals_.left_out())
    audit("refused", std::to_string(count) + " more calls, which are not in this log", reason, {});
}

Answer<Caller> Access::find(Method method, std::string_view authorization, const std::string& address,
                            const std::string& certificate) const {
  std::shared_ptr<const Tokens> tokens;
  std::shared_ptr<const JsonWebTokens> web_tokens;
  {
    std::lock_guard lock(mutex_);
    tokens = tokens_;
    web_tokens = web_tokens_;
  }
  if (issuer_keys_ != nullptr) web_tokens = issuer_keys_->current();
  if (names_certificates_) {
    if (method == Method::LivePage || method == Method::LivePageCancel) return page_without_tokens();
    if (certificate.empty()) return certificate_nameless();
    return Caller{certificate, certificate, kSubmit | kRead | kCancel};
  }
  if (!asks() && method == Method::LivePageCancel) return page_only_shows();
  if (!asks()) return Caller{"", address, kAllRights};
  const std::string_view token = token_of(authorization);
  if (token.empty()) return token_missing();
  auto principal = tokens == nullptr ? std::nullopt : tokens->find(token, clock_());
  if (!principal && web_tokens != nullptr) principal = web_tokens->find(token, clock_());
  if (!principal && issuer_keys_ != nullptr && issuer_keys_->ask_for(token)) return keys_unavailable();
  if (!principal) return token_unknown();
  const MethodRule& rule = rule_of(method);
  if (!principal->rights.contains(rule.needed))
    return right_missing(principal->name, names_of(rule.needed.without(principal->rights)),
                         std::string(rule.name.substr(rule.name.rfind('/') + 1)));
  return Caller{principal->name, principal->name, principal->rights};
}

Expected<bool> Access::refresh() {
  const auto tokens = refresh_tokens(), keys = refresh_web_tokens();
  if (!tokens) return tokens;
  if (!keys) return keys;
  return *tokens || *keys;
}

Expected<bool> Access::refresh_tokens() {
  if (tokens_ == nullptr) return false;
  const auto version = version_of(file_);
  const Version seen = version ? *version : Version();
  if (seen == version_) return false;
  version_ = seen;
  if (!version) return tl::unexpected(version.error());
  auto loaded = load(file_);
  if (!loaded) return tl::unexpected(loaded.error());
  auto tokens = std::make_shared<const Tokens>(std::move(loaded->tokens));
  std::lock_guard lock(mutex_);
  tokens_ = std::move(tokens);
  return true;
}

Expected<bool> Access::fetch_keys() {
  if (issuer_keys_ == nullptr) return false;
  if (failed_at_start_) return tl::unexpected(*std::exchange(failed_at_start_, std::nullopt));
  return issuer_keys_->refresh();
}

Expected<bool> Access::refresh_web_tokens() {
  if (web_tokens_ == nullptr) return false;
  const auto version = version_of(web_token_settings_.keys);
  const Version seen = version ? *version : Version();
  if (seen == keys_version_) return false;
  keys_version_ = seen;
  auto text = read(web_token_settings_.keys);
  if (!text) return tl::unexpected(text.error());
  auto keys = JsonWebTokens::parse(web_token_settings_, text->text);
  if (!keys) return tl::unexpected(keys.error());
  std::lock_guard lock(mutex_);
  web_tokens_ = std::move(*keys);
  return true;
}

}  // namespace varimesh::server
