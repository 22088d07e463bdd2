// Calls of an S3 server: small steps that are repeated until they succeed.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/failure.h"
#include "server/meshes/s3/address.h"
#include "server/meshes/s3/xml.h"
#include "server/meshes/shared/object_store.h"

namespace varimesh::server {

struct S3Settings {
  S3Address address;
  std::function<Expected<S3Credentials>()> credentials = read_s3_credentials;
  std::function<void(const std::string&)> log = [](const std::string&) {};
  std::chrono::milliseconds connect_timeout{5'000};
  /// A request that moves fewer than 1 KiB a second for this long is begun again.
  std::chrono::seconds stalled{15};
};

/// While the server is known to be away, the time counts from the first failure: a call with little patience then fails
/// at its first try.
using S3Patience = Patience;

/// Puts, gets, lists and removes the objects of one prefix of a bucket. Thread-safe.
///
/// A call is repeated, with growing pauses, after answers such as 503, connections that break or stall, and bodies that
/// are cut. No request has more than kPieceBytes of body in either direction, so little is lost by that. Failures:
/// UNAVAILABLE if the patience has ended, INTERNAL if the server refuses the request.
class S3Client {
 public:
  explicit S3Client(S3Settings settings);
  ~S3Client();

  /// Bytes of one request. Larger objects are stored in several parts and read in several ranges.
  static constexpr std::int64_t kPieceBytes = std::int64_t{8} << 20;

  /// Stores a small object and returns its tag.
  Answer<std::string> put(const std::string& key, std::string_view bytes, S3Patience patience);
  /// Stores a small object unless there is one, if the server knows that condition.
  Answer<void> put_if_absent(const std::string& key, std::string_view bytes, S3Patience patience);
  /// Stores the first `size` bytes of a file. The object is there whole or not at all.
  Answer<void> put_file(const std::string& key, int file, std::int64_t size, S3Patience patience);
  /// Returns `size` bytes from `offset` on, at most kPieceBytes. NOT_FOUND if there is no such object, or if it ends
  /// before.
  Answer<std::string> get(const std::string& key, std::int64_t offset, std::int64_t size, S3Patience patience);
  /// Returns a small object, all of it. NOT_FOUND.
  Answer<std::string> get_small(const std::string& key, S3Patience patience);
  /// Appends `size` bytes of an object, from its begin, to a file. NOT_FOUND; STORE_FULL if the disk is full.
  Answer<void> get_file(const std::string& key, std::int64_t size, int file, S3Patience patience);
  /// Removes an object if it is there.
  Answer<void> remove(const std::string& key, S3Patience patience);
  /// Returns all objects whose keys begin with this, in the order of their keys.
  Answer<std::vector<S3Object>> list(const std::string& beginning, S3Patience patience);

  /// Bytes of bodies sent and received since the start.
  std::int64_t sent() const { return sent_; }
  std::int64_t received() const { return received_; }

 private:
  struct Request;
  struct Response;
  struct Handles;
  /// What to do after a response.
  enum class Verdict { Good, Absent, Again, Refused };

  /// Sends a request until it is answered or refused, or the patience has ended. NOT_FOUND for 404.
  Answer<Response> send(const Request& request, S3Patience patience);
  Response send_once(const Request& request);
  Verdict judge(const Request& request, const Response& response);
  Refusal refused(const Response& response);
  bool renew_credentials();
  std::string url_of(const Request& request) const;
  std::string key_of(const std::string& key) const { return settings_.address.prefix + key; }
  // multipart.cpp:
  Answer<void> put_parts(const std::string& key, int file, std::int64_t size, S3Patience patience);
  Answer<std::string> send_parts(const std::string& key, const std::string& upload, int file, std::int64_t size,
                                 S3Patience patience);
  /// Whether the object is there whole, when the answer to the last step of an upload was lost.
  bool is_there(const std::string& key, std::int64_t size, S3Patience patience);

  const S3Settings settings_;
  std::mutex mutex_;  ///< Guards the next three.
  S3Credentials credentials_;
  std::optional<std::chrono::steady_clock::time_point> lost_since_;  ///< When the server was reached no more.
  std::unique_ptr<Handles> handles_;
  std::atomic<std::int64_t> sent_ = 0, received_ = 0;
};

/// The beginning of a text in a URL: letters, digits and "-_.~" as they are, others as %XX.
std::string percent_encoded(std::string_view text);

}  // namespace varimesh::server
