// The keys of an OpenID Connect issuer, fetched from it.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "server/access/json_web_tokens.h"

namespace varimesh::server {

/// Says when the keys are fetched: at first, every hour, after a failure every half minute, and when a token names a
/// key that is not among them, but then no sooner than a minute after the last time, since anybody can make up such
/// tokens. Keys that could not be fetched again for a day are no longer used. Thread-safe.
class IssuerKeys {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `settings` are fetched ones (JsonWebTokenSettings::are_fetched()).
  explicit IssuerKeys(JsonWebTokenSettings settings, std::function<Time()> clock = std::chrono::steady_clock::now)
      : settings_(std::move(settings)), clock_(std::move(clock)) {}

  /// The keys; null: there are none.
  std::shared_ptr<const JsonWebTokens> current() const;
  /// Called for a token that the keys do not know. Returns whether other keys may know it soon: they are being fetched,
  /// or will be because of this call, or there are none.
  bool ask_for(std::string_view token);
  /// Called regularly, by one thread: fetches the keys if it is time. Returns whether it did. Errors: why they could
  /// not be fetched or used.
  Expected<bool> refresh();

 private:
  Expected<std::string> fetch_set() const;

  const JsonWebTokenSettings settings_;
  const std::function<Time()> clock_;
  mutable std::mutex mutex_;  ///< Guards everything below. Not held while keys are fetched.
  std::shared_ptr<const JsonWebTokens> keys_;
  Time tried_{}, fetched_{};  ///< When fetching was last tried, and when it last succeeded.
  bool is_first_ = true, has_failed_ = false, is_wanted_ = false, is_fetching_ = false;
};

}  // namespace varimesh::server
