// Who calls: the door of the server.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "server/access/issuer_keys.h"
#include "server/access/json_web_tokens.h"
#include "server/access/rights.h"
#include "server/access/tokens.h"
#include "server/failure.h"
#include "server/log/line_rate.h"
#include "server/log/log_fields.h"
#include "server/tracing/trace_context.h"

namespace varimesh::server {

/// Who calls, and what the caller may do.
struct Caller {
  std::string owner;  ///< Whose jobs the caller submits. Empty: the server does not ask.
  std::string peer;   ///< Who the limits per peer count: the owner or, if the server does not ask, the address.
  Rights rights;
  std::string address = {};  ///< From where the caller calls, without the port.
  TraceContext trace = {};   ///< Of the call.
  LogFields log_fields() const { return {.owner = owner, .address = address, .trace_id = trace.trace_id}; }
  /// Whether the jobs and meshes of all owners are there for this caller.
  bool sees_all() const { return rights.contains(kAdmin); }
};

/// Lets callers in by their tokens or certificates. Thread-safe.
class Access {
 public:
  /// A server that does not ask who calls: everybody may do everything.
  Access() = default;
  /// Reads the tokens of a file. Errors: BadOption if it cannot be read, if others can write it, or if a line is wrong.
  static Expected<std::unique_ptr<Access>> with_tokens(
      const std::string& file, std::function<WallTime()> clock = std::chrono::system_clock::now);

  /// Reads the tokens of a file and accepts JSON Web Tokens, either or both. Errors: as with_tokens(), and those of
  /// JsonWebTokens::parse().
  static Expected<std::unique_ptr<Access>> with_tokens(
      const std::string& file, const JsonWebTokenSettings& web_tokens,
      std::function<WallTime()> clock = std::chrono::system_clock::now);

  /// A server whose callers have certificates: the name in it is the owner, who may do everything but see what belongs
  /// to others.
  static std::unique_ptr<Access> with_certificates();

  /// Returns the caller of a method. UNAUTHENTICATED (TOKEN_MISSING or TOKEN_UNKNOWN) without a valid token,
  /// UNAVAILABLE (KEYS_UNAVAILABLE) if keys that may know it are about to be fetched, PERMISSION_DENIED (RIGHT_MISSING)
  /// if the token does not allow the method. `authorization`: the header of that name, "Bearer TOKEN". `address`: the
  /// address of the caller, without its port. `certificate`: the name in the caller's certificate, if
  /// names_certificates(); without one: UNAUTHENTICATED (CERTIFICATE_NAMELESS). Browsers show none on the admin port:
  /// PERMISSION_DENIED (RIGHT_MISSING). Every refusal is in the log.
  Answer<Caller> admit(Method method, std::string_view authorization, const std::string& address,
                       const std::string& certificate = {}) const;
  /// Whether it matters who calls.
  bool asks() const {
    return tokens_ != nullptr || web_tokens_ != nullptr || issuer_keys_ != nullptr || names_certificates_;
  }
  /// Whether the owner is the name in the caller's certificate.
  bool names_certificates() const { return names_certificates_; }

  /// Called regularly, by one thread: reads the files again that have changed, and returns whether one did. Errors: as
  /// with_tokens(), once for each change; then the tokens stay as they were.
  Expected<bool> refresh();
  /// Called regularly, by one thread: fetches the keys of the issuer if it is time, which may take some seconds.
  /// Returns whether it did. Errors: as IssuerKeys::refresh(). The first are fetched when the object is made; if that
  /// fails, the first call says so.
  Expected<bool> fetch_keys();
  /// Writes down how many refusals of each kind were left out of the log. Called regularly.
  void note_left_out();

 private:
  /// What shows that the file has changed.
  struct Version {
    std::int64_t modified = 0, size = 0;
    std::uint64_t inode = 0;
    bool operator==(const Version&) const = default;
  };
  struct Loaded {
    Tokens tokens;
    Version version;
  };
  /// The text of a file that only this user or root can write.
  struct Text {
    std::string text;
    Version version;
  };
  static Expected<Text> read(const std::string& file);
  static Expected<Loaded> load(const std::string& file);
  Expected<bool> refresh_tokens();
  Expected<bool> refresh_web_tokens();
  Answer<Caller> find(Method method, std::string_view authorization, const std::string& address,
                      const std::string& certificate) const;
  static Expected<Version> version_of(const std::string& file);

  static constexpr int kMostRefusalsAMinute = 60;

  mutable LineRate refusals_{kMostRefusalsAMinute};  ///< In the log, by reason.
  bool names_certificates_ = false;
  std::string file_;
  std::function<WallTime()> clock_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Tokens> tokens_;             ///< Null: there is no file of tokens.
  std::shared_ptr<const JsonWebTokens> web_tokens_;  ///< Null: none are accepted.
  JsonWebTokenSettings web_token_settings_;
  std::unique_ptr<IssuerKeys> issuer_keys_;  ///< Null: web_tokens_ come from a file, or are not accepted.
  std::optional<Error> failed_at_start_;     ///< Why the first keys could not be fetched, until that was said.
  Version version_, keys_version_;           ///< Of the newest attempts to read the files.
};

}  // namespace varimesh::server
