// A queue, and a thread that sends it.
#include "server/tracing/exporter.h"

#include <curl/curl.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "core/base/utf8.h"
#include "server/tracing/encode.h"

namespace varimesh::server {
namespace {

using std::chrono::steady_clock, std::chrono::milliseconds, std::chrono::seconds;

constexpr std::size_t kMostInRequest = 512, kMostAnswer = 1 << 20;
constexpr milliseconds kLongestPause{30'000}, kForTheRest{2'000};

std::size_t take_body(char* bytes, std::size_t one, std::size_t count, void* to) {
  auto& body = *static_cast<std::string*>(to);
  if (body.size() + count * one > kMostAnswer) return 0;
  body.append(bytes, count * one);
  return count * one;
}

struct Sent {
  enum class Verdict { Taken, Again, Refused } verdict = Verdict::Again;
  std::string why = {};
  milliseconds retry_after{0};  ///< 0: the collector has not said when.
};

class Exporter {
 public:
  explicit Exporter(const ExportSettings& settings) : settings_(settings), handle_(curl_easy_init()) {
    headers_ = curl_slist_append(headers_, "Content-Type: application/x-protobuf");
    headers_ = curl_slist_append(headers_, "Expect:");
    for (std::size_t begin = 0; begin < settings_.headers.size();) {
      const std::size_t end = std::min(settings_.headers.find(',', begin), settings_.headers.size());
      std::string header = settings_.headers.substr(begin, end - begin);
      if (const std::size_t equals = header.find('='); equals != std::string::npos)
        headers_ = curl_slist_append(headers_, header.replace(equals, 1, ": ").c_str());
      begin = end + 1;
    }
    thread_ = std::thread([this] { run(); });
  }
  ~Exporter() {
    {
      std::lock_guard lock(mutex_);
      give_up_ = steady_clock::now() + kForTheRest;
      stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
    curl_slist_free_all(headers_);
    curl_easy_cleanup(handle_);
  }
  Exporter(const Exporter&) = delete;
  Exporter& operator=(const Exporter&) = delete;

  void take(Span span) {
    std::lock_guard lock(mutex_);
    if (waiting_.size() >= settings_.most_waiting)
      ++dropped_;
    else
      waiting_.push_back(std::move(span));
  }

 private:
  /// Waits, and returns false if there is no time left to send anything.
  bool rest(milliseconds pause) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, pause, [this] { return stopping_; });
    return !stopping_ || (!waiting_.empty() && steady_clock::now() < give_up_);
  }

  void run() {
    milliseconds pause = settings_.pause;
    while (rest(pause)) {
      pause = settings_.pause;
      std::vector<Span> batch = next();
      if (batch.empty()) continue;
      const Sent sent = send(encode_spans(settings_.resource, batch));
      note(sent);
      if (sent.verdict != Sent::Verdict::Again) continue;
      if (stops()) return;
      put_back(std::move(batch));
      failures_ = std::min(failures_ + 1, 5);
      pause = std::min(kLongestPause, sent.retry_after.count() > 0 ? sent.retry_after : pause * (1 << failures_));
    }
  }

  bool stops() {
    std::lock_guard lock(mutex_);
    return stopping_;
  }

  std::vector<Span> next() {
    std::lock_guard lock(mutex_);
    const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(std::min(waiting_.size(), kMostInRequest));
    std::vector<Span> batch(std::make_move_iterator(waiting_.begin()), std::make_move_iterator(end));
    waiting_.erase(waiting_.begin(), end);
    return batch;
  }

  void put_back(std::vector<Span> batch) {
    std::lock_guard lock(mutex_);
    waiting_.insert(waiting_.begin(), std::make_move_iterator(batch.begin()), std::make_move_iterator(batch.end()));
  }

  /// Logs when the collector is lost, when it is back, and what it has refused.
  void note(const Sent& sent) {
    std::size_t dropped = 0;
    if (sent.verdict != Sent::Verdict::Again) {
      failures_ = 0;
      std::lock_guard lock(mutex_);
      dropped = std::exchange(dropped_, 0);
    }
    const bool away = sent.verdict == Sent::Verdict::Again;
    if (away && !std::exchange(is_away_, true))
      settings_.log("the collector of traces cannot be reached (" + sent.why + ")");
    if (!away && std::exchange(is_away_, false)) settings_.log("the collector of traces is back");
    if (!away && !sent.why.empty()) settings_.log("the collector has not taken spans: " + sent.why);
    if (dropped > 0) settings_.log(std::to_string(dropped) + " spans were dropped while the collector was away");
  }

  Sent send(const std::string& body) {
    if (handle_ == nullptr) return {Sent::Verdict::Refused, "libcurl cannot begin a request"};
    const std::string url = settings_.url + "/v1/traces";
    std::string answer;
    char why[CURL_ERROR_SIZE] = "";
    curl_easy_setopt(handle_, CURLOPT_URL, url.c_str());
    curl_easy_setopt(handle_, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(handle_, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(handle_, CURLOPT_ERRORBUFFER, why);
    curl_easy_setopt(handle_, CURLOPT_CONNECTTIMEOUT_MS, 2'000L);
    curl_easy_setopt(handle_, CURLOPT_TIMEOUT_MS, stops() ? static_cast<long>(kForTheRest.count()) : 10'000L);
    curl_easy_setopt(handle_, CURLOPT_HTTPHEADER, headers_);
    curl_easy_setopt(handle_, CURLOPT_POST, 1L);
    curl_easy_setopt(handle_, CURLOPT_POSTFIELDS, body.data());
    curl_easy_setopt(handle_, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body.size()));
    curl_easy_setopt(handle_, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(handle_, CURLOPT_WRITEDATA, &answer);
    const CURLcode done = curl_easy_perform(handle_);
    if (done != CURLE_OK) return {Sent::Verdict::Again, why[0] != '\0' ? why : curl_easy_strerror(done)};
    long status = 0;
    curl_off_t after = 0;
    curl_easy_getinfo(handle_, CURLINFO_RESPONSE_CODE, &status);
    curl_easy_getinfo(handle_, CURLINFO_RETRY_AFTER, &after);
    if (status / 100 == 2) return {Sent::Verdict::Taken, as_plain_text(rejection_in(answer))};
    const std::string said = "HTTP status " + std::to_string(status);
    // The answers after which OTLP lets a client try again.
    const bool again = status == 429 || status == 502 || status == 503 || status == 504;
    return {again ? Sent::Verdict::Again : Sent::Verdict::Refused, said, seconds(after)};
  }

  const ExportSettings settings_;
  CURL* const handle_;
  curl_slist* headers_ = nullptr;
  std::mutex mutex_;  ///< Guards the next five.
  std::condition_variable changed_;
  std::deque<Span> waiting_;
  std::size_t dropped_ = 0;
  bool stopping_ = false;
  steady_clock::time_point give_up_{};
  bool is_away_ = false;  ///< This and the next are of the thread.
  int failures_ = 0;
  std::thread thread_;
};

}  // namespace

Expected<SpanSink> export_spans(const ExportSettings& settings) {
  const bool is_address = settings.url.starts_with("http://") || settings.url.starts_with("https://");
  if (!is_address || settings.url.find_first_of(" @?#") != std::string::npos)
    return tl::unexpected(Error{Error::Kind::BadOption,
                                "A collector of traces is http://HOST:PORT or https://HOST:PORT, "
                                "not '" +
                                    as_plain_text(settings.url) + "'; keys belong into OTEL_EXPORTER_OTLP_HEADERS."});
  static const CURLcode started = curl_global_init(CURL_GLOBAL_ALL);
  if (started != CURLE_OK) return tl::unexpected(Error{Error::Kind::Output, "libcurl cannot be used for --traces."});
  ExportSettings kept = settings;
  while (kept.url.ends_with('/')) kept.url.pop_back();
  return SpanSink([exporter = std::make_shared<Exporter>(kept)](Span span) { exporter->take(std::move(span)); });
}

}  // namespace varimesh::server
