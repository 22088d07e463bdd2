// Signs, sends and repeats requests. libcurl signs them (AWS signature version 4). Three things it leaves to its
// caller, in version 7.88: the query must be written as it is signed, which is sorted, with a "=" behind every key; a
// header must say the digest of the body; and only headers with a value may be given.
#include "server/meshes/s3/client.h"

#include <curl/curl.h>

#include <algorithm>
#include <random>
#include <thread>

#include "core/base/sha256.h"
#include "server/meshes/s3/request.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// No answer is longer: the longest are a piece of an object, and a list of a thousand keys.
constexpr std::size_t kMostAnswer = static_cast<std::size_t>(S3Client::kPieceBytes) + (1 << 20);
constexpr std::chrono::milliseconds kFirstPause{50}, kLongestPause{2'000};

std::size_t take_body(char* bytes, std::size_t one, std::size_t count, void* to) {
  auto& body = *static_cast<std::string*>(to);
  if (body.size() + count * one > kMostAnswer) return 0;
  body.append(bytes, count * one);
  return count * one;
}

std::size_t take_header(char* bytes, std::size_t one, std::size_t count, void* to) {
  std::string_view line(bytes, count * one);
  constexpr std::string_view kTag = "etag:";
  if (line.size() > kTag.size() && std::ranges::equal(line.substr(0, kTag.size()), kTag, [](char left, char right) {
        return (left >= 'A' && left <= 'Z' ? left + ('a' - 'A') : left) == right;
      })) {
    line.remove_prefix(kTag.size());
    const auto first = line.find_first_not_of(" \t"), last = line.find_last_not_of(" \t\r\n");
    if (first != std::string_view::npos) *static_cast<std::string*>(to) = line.substr(first, last - first + 1);
  }
  return count * one;
}

/// A pause that differs from caller to caller, so that a server that returns is not asked by all at once.
std::chrono::milliseconds about(std::chrono::milliseconds pause) {
  thread_local std::minstd_rand chance(std::random_device{}());
  return pause * std::uniform_int_distribution<int>(50, 100)(chance) / 100;
}

}  // namespace

/// Connections that are open and not in use.
struct S3Client::Handles {
  ~Handles() {
    for (CURL* const handle : idle) curl_easy_cleanup(handle);
  }
  std::mutex mutex;
  std::vector<CURL*> idle;

  CURL* take() {
    std::lock_guard lock(mutex);
    if (idle.empty()) return curl_easy_init();
    CURL* const handle = idle.back();
    idle.pop_back();
    return handle;
  }
  void give_back(CURL* handle) {
    curl_easy_reset(handle);  // its connections stay open
    std::lock_guard lock(mutex);
    idle.push_back(handle);
  }
};

S3Client::S3Client(S3Settings settings) : settings_(std::move(settings)), handles_(std::make_unique<Handles>()) {
  static const CURLcode started = curl_global_init(CURL_GLOBAL_ALL);
  if (started != CURLE_OK) settings_.log("libcurl cannot be used");
  renew_credentials();
}

S3Client::~S3Client() = default;

// ===== one request =====

std::string percent_encoded(std::string_view text) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string encoded;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if ((letter >= '0' && letter <= '9') || (letter >= 'A' && letter <= 'Z') || (letter >= 'a' && letter <= 'z') ||
        std::string_view("-_.~").find(letter) != std::string_view::npos)
      encoded += letter;
    else
      (encoded += '%') += {kDigits[code / 16], kDigits[code % 16]};
  }
  return encoded;
}

std::string S3Client::url_of(const Request& request) const {
  // Keys and prefixes have only letters that stand for themselves.
  std::string url = settings_.address.endpoint + '/' + settings_.address.bucket + '/' + request.key;
  if (!request.query.empty()) url += '?' + request.query;
  return url;
}

bool S3Client::renew_credentials() {
  auto read = settings_.credentials();
  std::lock_guard lock(mutex_);
  const bool is_new = read && (read->key_id != credentials_.key_id || read->secret != credentials_.secret ||
                               read->token != credentials_.token);
  if (is_new) credentials_ = std::move(*read);
  return is_new;
}

S3Client::Response S3Client::send_once(const Request& request) {
  CURL* const handle = handles_->take();
  Response response;
  if (handle == nullptr) {
    response.error = "libcurl cannot begin a request";
    return response;
  }
  S3Credentials credentials;
  {
    std::lock_guard lock(mutex_);
    credentials = credentials_;
  }
  const std::string url = url_of(request), signing = "aws:amz:" + settings_.address.region + ":s3";
  curl_slist* headers = nullptr;
  const auto add = [&](const std::string& header) { headers = curl_slist_append(headers, header.c_str()); };
  add("x-amz-content-sha256: " + sha256(request.body));
  if (!credentials.token.empty()) add("x-amz-security-token: " + credentials.token);
  const bool has_body = request.method == "PUT" || request.method == "POST";
  if (has_body) add("Content-Type: application/octet-stream");
  for (const std::string& header : request.headers) add(header);

  char why[CURL_ERROR_SIZE] = "";
  curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle, CURLOPT_PATH_AS_IS, 1L);
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle, CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_ERRORBUFFER, why);
  curl_easy_setopt(handle, CURLOPT_AWS_SIGV4, signing.c_str());
  curl_easy_setopt(handle, CURLOPT_USERNAME, credentials.key_id.c_str());
  curl_easy_setopt(handle, CURLOPT_PASSWORD, credentials.secret.c_str());
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle, CURLOPT_CUSTOMREQUEST, request.method.c_str());
  if (has_body) {
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body.empty() ? "" : request.body.data());
  }
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(settings_.connect_timeout.count()));
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, 1024L);
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME, static_cast<long>(settings_.stalled.count()));
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, take_body);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &response.body);
  curl_easy_setopt(handle, CURLOPT_HEADERFUNCTION, take_header);
  curl_easy_setopt(handle, CURLOPT_HEADERDATA, &response.tag);
  const CURLcode done = curl_easy_perform(handle);
  if (done == CURLE_OK) {
    curl_easy_getinfo(handle, CURLINFO_RESPONSE_CODE, &response.status);
  } else {
    response.error = *why != '\0' ? why : curl_easy_strerror(done);
    response.is_permanent = done == CURLE_PEER_FAILED_VERIFICATION || done == CURLE_UNSUPPORTED_PROTOCOL ||
                            done == CURLE_URL_MALFORMAT || done == CURLE_SSL_CACERT_BADFILE;
  }
  curl_slist_free_all(headers);
  handles_->give_back(handle);
  received_ += static_cast<std::int64_t>(response.body.size());
  if (done == CURLE_OK) sent_ += static_cast<std::int64_t>(request.body.size());
  return response;
}

// ===== until it succeeds =====

S3Client::Verdict S3Client::judge(const Request& request, const Response& response) {
  const bool is_cut = (request.expected >= 0 && static_cast<std::int64_t>(response.body.size()) != request.expected) ||
                      response.body.find(request.end) == std::string::npos;
  if (response.is_permanent) return Verdict::Refused;
  if (response.status == 200 || response.status == 204 || response.status == 206)
    return is_cut ? Verdict::Again : Verdict::Good;
  const std::string code = text_of(response.body, "Code");
  if (response.status == 404) return code == "NoSuchBucket" ? Verdict::Refused : Verdict::Absent;
  if (response.status == 416) return Verdict::Absent;  // the object ends before the range
  const bool is_passing = response.status == 0 || response.status >= 500 || response.status == 429 ||
                          response.status == 408 || code == "RequestTimeout" || code == "IncompleteBody" ||
                          code == "BadDigest" || code == "XAmzContentSHA256Mismatch" || code == "OperationAborted";
  return is_passing ? Verdict::Again : Verdict::Refused;
}

Refusal S3Client::refused(const Response& response) {
  std::string why = text_of(response.body, "Code");
  if (why.empty()) why = response.status == 0 ? response.error : "status " + std::to_string(response.status);
  settings_.log("The S3 server of the meshes refuses a request: " + why + "; check the address and the credentials.");
  return internal_failure("The server's store of meshes refuses a request (" + why +
                          "); ask the server's operator to check the bucket and its credentials.");
}

Answer<S3Client::Response> S3Client::send(const Request& request, S3Patience patience) {
  using std::chrono::steady_clock;
  const auto start = steady_clock::now();
  bool has_new_credentials = false;
  for (auto pause = kFirstPause;; pause = std::min(pause * 2, kLongestPause)) {
    Response response = send_once(request);
    Verdict verdict = judge(request, response);
    // Those in a file are renewed from time to time.
    if (verdict == Verdict::Refused && (response.status == 401 || response.status == 403) && !has_new_credentials &&
        (has_new_credentials = renew_credentials()))
      continue;
    steady_clock::time_point since = start;
    {
      std::lock_guard lock(mutex_);
      if (verdict != Verdict::Again) lost_since_.reset();
      if (verdict == Verdict::Again && !lost_since_) {
        lost_since_ = steady_clock::now();
        settings_.log("The S3 server of the meshes fails (" +
                      (response.status == 0 ? response.error : "status " + std::to_string(response.status)) +
                      "); its calls are repeated.");
      }
      since = lost_since_.value_or(start);
    }
    if (verdict == Verdict::Good) return response;
    if (verdict == Verdict::Absent) return mesh_not_found(request.key);
    if (verdict == Verdict::Refused) return refused(response);
    if (steady_clock::now() + pause - since >= patience) return meshes_unavailable();
    std::this_thread::sleep_for(about(pause));
  }
}

// ===== small objects =====

Answer<std::string> S3Client::put(const std::string& key, std::string_view bytes, S3Patience patience) {
  auto done = send({.method = "PUT", .key = key_of(key), .body = bytes}, patience);
  if (!done) return tl::unexpected(done.error());
  return std::move(done->tag);
}

Answer<void> S3Client::put_if_absent(const std::string& key, std::string_view bytes, S3Patience patience) {
  if (get_small(key, patience)) return {};
  const Request request{.method = "PUT", .key = key_of(key), .body = bytes, .headers = {"If-None-Match: *"}};
  const auto done = send(request, patience);
  if (done || get_small(key, patience)) return {};  // another server was first
  return tl::unexpected(done.error());
}

Answer<std::string> S3Client::get(const std::string& key, std::int64_t offset, std::int64_t size, S3Patience patience) {
  if (size == 0) return std::string();
  const std::string range = std::to_string(offset) + "-" + std::to_string(offset + size - 1);
  auto done =
      send({.method = "GET", .key = key_of(key), .headers = {"Range: bytes=" + range}, .expected = size}, patience);
  if (!done) return tl::unexpected(done.error());
  return std::move(done->body);
}

Answer<std::string> S3Client::get_small(const std::string& key, S3Patience patience) {
  auto done = send({.method = "GET", .key = key_of(key)}, patience);
  if (!done) return tl::unexpected(done.error());
  return std::move(done->body);
}

Answer<void> S3Client::remove(const std::string& key, S3Patience patience) {
  const auto done = send({.method = "DELETE", .key = key_of(key)}, patience);
  if (!done && done.error().code != Failure::Code::NotFound) return tl::unexpected(done.error());
  return {};
}

Answer<std::vector<S3Object>> S3Client::list(const std::string& beginning, S3Patience patience) {
  return all_pages([&](const std::string& next) -> Answer<S3Page> {
    const std::string from = next.empty() ? "" : "continuation-token=" + percent_encoded(next) + "&";
    const Request request{.method = "GET",
                          .query = from + "list-type=2&prefix=" + percent_encoded(key_of(beginning)),
                          .end = "</ListBucketResult>"};
    const auto done = send(request, patience);
    if (!done) return tl::unexpected(done.error());
    return parse_page(done->body, settings_.address.prefix);
  });
}

}  // namespace varimesh::server
