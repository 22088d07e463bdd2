// Whom the server may call at the end of a job: the operator's list.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "server/failure.h"

namespace varimesh::server {

/// One line of the list.
struct Receiver {
  std::string origin;           ///< "https://ci.example.org" or "http://10.0.0.5:8080", in small letters.
  std::string key;              ///< The bytes with which calls are signed.
  bool may_be_private = false;  ///< It may have an address that is not public.
};

/// The file of --webhooks: a receiver each line, as ORIGIN KEY or ORIGIN KEY private. KEY is "whsec_" and 24 to 64
/// bytes in base64, as Standard Webhooks has it. Only a private one may have http:// in place of https://. What follows
/// a '#' is a comment.
class Receivers {
 public:
  /// Errors: BadOption, with the number of the line that is wrong.
  static Expected<Receivers> parse(std::string_view text);

  /// The receiver of an address; null: it is none of them.
  const Receiver* find(std::string_view url) const;
  std::size_t size() const { return all_.size(); }

 private:
  std::vector<Receiver> all_;
};

/// The beginning of an address up to its path, in small letters: "https://ci.example.org:8443"; port 443 of https and
/// port 80 of http are left out. Nothing if the address does not begin with https:// or http:// and the name or number
/// of a host, has a user's name before the host, or has other letters than an address may have.
std::optional<std::string> origin_of(std::string_view url);

/// INVALID_ARGUMENT (BAD_OPTION) unless the address is one that `receivers` allow. Null: the server calls nobody.
Answer<void> check_webhook(std::string_view url, const Receivers* receivers);

/// The header webhook-signature of Standard Webhooks: HMAC-SHA256 over the id, the time in seconds since 1970 and the
/// body.
std::string webhook_signature(std::string_view key, std::string_view id, std::string_view time, std::string_view body);

}  // namespace varimesh::server
