// When keys are fetched, and from where.
#include "server/access/issuer_keys.h"

#include <nlohmann/json.hpp>
#include <utility>

namespace varimesh::server {
namespace {

constexpr std::chrono::hours kAge{1}, kMostAge{24};
constexpr std::chrono::seconds kAfterFailure{30}, kBetweenUnknown{60};

}  // namespace

std::shared_ptr<const JsonWebTokens> IssuerKeys::current() const {
  const std::lock_guard lock(mutex_);
  return keys_ == nullptr || clock_() - fetched_ > kMostAge ? nullptr : keys_;
}

bool IssuerKeys::ask_for(std::string_view token) {
  if (!JsonWebTokens::looks_like_one(token)) return false;
  const std::lock_guard lock(mutex_);
  if (keys_ == nullptr) return true;
  if (!keys_->lacks_key_of(token)) return false;
  if (is_wanted_ || is_fetching_) return true;
  is_wanted_ = clock_() - tried_ >= kBetweenUnknown;
  return is_wanted_;
}

Expected<bool> IssuerKeys::refresh() {
  {
    const std::lock_guard lock(mutex_);
    const auto since = clock_() - tried_;
    if (!is_first_ && !is_wanted_ && since < (has_failed_ ? kAfterFailure : std::chrono::seconds(kAge))) return false;
    is_first_ = is_wanted_ = false;
    is_fetching_ = true;
    tried_ = clock_();
  }
  auto text = fetch_set();
  auto keys = text ? JsonWebTokens::parse(settings_, *text)
                   : Expected<std::shared_ptr<const JsonWebTokens>>(tl::unexpected(text.error()));
  const std::lock_guard lock(mutex_);
  is_fetching_ = false;
  has_failed_ = !keys;
  if (!keys) return tl::unexpected(keys.error());
  keys_ = std::move(*keys);
  fetched_ = clock_();
  return true;
}

Expected<std::string> IssuerKeys::fetch_set() const {
  if (!settings_.keys.empty()) return settings_.fetch(settings_.keys, settings_.authority);
  // OpenID Connect Discovery 1.0, section 4.
  const std::string slash = settings_.issuer.ends_with('/') ? "" : "/";
  const std::string url = settings_.issuer + slash + ".well-known/openid-configuration";
  const auto text = settings_.fetch(url, settings_.authority);
  if (!text) return tl::unexpected(text.error());
  const auto said = nlohmann::json::parse(*text, nullptr, false);
  const auto word = [&](const char* name) {
    const auto found = said.is_object() ? said.find(name) : said.end();
    return said.is_object() && found != said.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (word("issuer") != settings_.issuer)
    return bad_option("'" + url + "' is not the configuration of the issuer '" + settings_.issuer + "'.");
  const std::string keys = word("jwks_uri");
  if (!is_https(keys)) return bad_option("'" + url + "' names no keys (jwks_uri) at an address with https://.");
  return settings_.fetch(keys, settings_.authority);
}

}  // namespace varimesh::server
