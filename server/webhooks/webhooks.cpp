#include "server/webhooks/webhooks.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include "server/log/log_fields.h"
#include "server/tls/private_file.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {
namespace {

constexpr int kThreads = 8, kMostOfReceiver = 2;
/// How long a claimed call stays with its server; longer than a call can take.
constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::milliseconds kLongestPause{3'600'000};
/// How often the store is asked for calls that became due, or that another server has left.
constexpr std::chrono::milliseconds kLook{500};
constexpr int kGone = 410;

Expected<std::string> text_of(const std::string& file) {
  if (auto checked = check_file_is_private("--webhooks", file); !checked) return tl::unexpected(checked.error());
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) return unusable("--webhooks", file, "it cannot be read");
  return text;
}

/// The job as GetJob answers, without what makes specs large; nothing if it cannot be written as JSON.
std::optional<std::string> body_of(const v1::Job& job) {
  v1::GetJobResponse response;
  *response.mutable_job() = job;
  response.mutable_job()->clear_webhook_call();
  v1::JobSpec& spec = *response.mutable_job()->mutable_spec();
  const auto labels = spec.labels();
  spec.Clear();
  *spec.mutable_labels() = labels;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(response, &text).ok()) return std::nullopt;
  return text;
}

}  // namespace

Expected<std::unique_ptr<Webhooks>> Webhooks::start(JobStore& jobs, WebhookSettings settings,
                                                    std::function<TimePoint()> clock,
                                                    std::function<void(CallEnd)> counted) {
  std::unique_ptr<Webhooks> webhooks(new Webhooks(jobs, std::move(settings), std::move(clock), std::move(counted)));
  if (!webhooks->are_taken()) return webhooks;
  if (const auto read = webhooks->refresh(); !read) return tl::unexpected(read.error());
  for (int i = 0; i < kThreads; ++i) webhooks->threads_.emplace_back([&all = *webhooks] { all.work(); });
  return webhooks;
}

Webhooks::Webhooks(JobStore& jobs, WebhookSettings settings, std::function<TimePoint()> clock,
                   std::function<void(CallEnd)> counted)
    : jobs_(jobs), settings_(std::move(settings)), clock_(std::move(clock)), counted_(std::move(counted)) {}

Webhooks::~Webhooks() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  woken_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

std::shared_ptr<const Receivers> Webhooks::receivers() const {
  const std::lock_guard lock(mutex_);
  return receivers_;
}

Answer<void> Webhooks::check(const v1::Webhook& webhook) const {
  return check_webhook(webhook.url(), receivers().get());
}

Expected<bool> Webhooks::refresh() {
  if (!are_taken()) return false;
  auto text = text_of(settings_.file);
  const std::string seen = text ? *text : text.error().sentence;
  if (seen == text_ && receivers_ != nullptr) return false;
  text_ = seen;
  if (!text) return tl::unexpected(text.error());
  auto parsed = Receivers::parse(*text);
  if (!parsed) return tl::unexpected(parsed.error());
  const std::lock_guard lock(mutex_);
  receivers_ = std::make_shared<const Receivers>(std::move(*parsed));
  return true;
}

void Webhooks::wake() {
  {
    const std::lock_guard lock(mutex_);
    ++news_;
  }
  woken_.notify_one();
}

void Webhooks::work() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const int seen = news_;
    lock.unlock();
    const bool more = call_next();
    lock.lock();
    if (!more) woken_.wait_for(lock, kLook, [&] { return stopping_ || news_ != seen; });
  }
}

std::shared_ptr<const void> Webhooks::place_at(const std::string& origin) {
  const std::lock_guard lock(mutex_);
  if (under_way_[origin] >= kMostOfReceiver) return nullptr;
  ++under_way_[origin];
  return {this, [this, origin](const void*) {
            const std::lock_guard release(mutex_);
            if (--under_way_[origin] == 0) under_way_.erase(origin);
          }};
}

bool Webhooks::call_next() {
  const auto claimed = jobs_.claim_call(kPatience);
  if (!claimed || !*claimed) return false;
  const v1::Job& job = **claimed;
  const LogScope scope({.job = job.name(), .owner = job.owner()});
  const std::string origin = origin_of(job.spec().webhook().url()).value_or("");
  const auto place = place_at(origin);
  const CallOutcome outcome =
      place == nullptr ? CallOutcome{job.webhook_call().error(), std::chrono::seconds(1), false} : call(job);
  // If the store cannot record the outcome, the call is made once more.
  if (const auto noted = jobs_.note_call(job.name(), outcome); !noted)
    spdlog::warn("the outcome of a call at the end of {} was not recorded: {}", job.name(), noted.error().sentence);
  if (!outcome.was_made) return true;
  const CallEnd end = outcome.again_after     ? CallEnd::Failed
                      : outcome.error.empty() ? CallEnd::Delivered
                                              : CallEnd::GivenUp;
  counted_(end);
  if (end == CallEnd::Delivered)
    spdlog::info("{} was called at the end of {}", origin, job.name());
  else
    spdlog::warn("{} could not be called at the end of {}, {}: {}", origin, job.name(),
                 end == CallEnd::GivenUp ? "which was given up" : "which is tried again", outcome.error);
  return true;
}

CallOutcome Webhooks::call(const v1::Job& job) {
  const auto receivers = this->receivers();
  const Receiver* const receiver = receivers->find(job.spec().webhook().url());
  if (receiver == nullptr) {
    // The list of this moment: the file may have got the receiver back meanwhile.
    const auto refused = check_webhook(job.spec().webhook().url(), receivers.get());
    return failed(job, refused.error().sentence);
  }
  auto body = body_of(job);
  if (!body) return failed(job, "The job cannot be written as JSON; please report it.", true);
  const std::string time = std::to_string(std::chrono::system_clock::to_time_t(clock_()));
  PostRequest request{
      job.spec().webhook().url(), {}, std::move(*body), settings_.authority, receiver->may_be_private, [this] {
        const std::lock_guard lock(mutex_);
        return stopping_;
      }};
  request.headers = {"Content-Type: application/json", "webhook-id: " + job.name(), "webhook-timestamp: " + time,
                     "webhook-signature: " + webhook_signature(receiver->key, job.name(), time, request.body)};
  const auto status = settings_.post(request);
  if (!status && request.given_up()) return {job.webhook_call().error(), std::chrono::milliseconds(0), false};
  if (!status) return failed(job, status.error().sentence);
  if (*status >= 200 && *status < 300) return {};
  return failed(job, "The receiver has answered with " + std::to_string(*status) + ".", *status == kGone);
}

CallOutcome Webhooks::failed(const v1::Job& job, const std::string& sentence, bool for_good) const {
  const int attempts = job.webhook_call().attempts() + 1;
  if (for_good || attempts >= settings_.most_attempts) return {sentence, {}};
  constexpr int kMostDoublings = 20;
  const auto pause = settings_.first_pause * (std::int64_t{1} << std::min(attempts - 1, kMostDoublings));
  return {sentence, std::min<std::chrono::milliseconds>(pause, kLongestPause)};
}

}  // namespace varimesh::server
