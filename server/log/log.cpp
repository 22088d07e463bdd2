// Sets up spdlog and passes the messages of gRPC to it.
#include "server/log/log.h"

#include <google/protobuf/stubs/common.h>
#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <chrono>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/utf8.h"

namespace varimesh::server {
namespace {

/// The message as one line of plain text, since a message may quote what a client has sent: a line break in it would
/// forge a line of the log.
class PlainMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& line) override {
    const std::string text = as_plain_text({message.payload.data(), message.payload.size()});
    line.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<PlainMessage>(); }
};

/// The line as a JSON object.
class JsonLine : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& line) override {
    const LogFields& fields = log_fields();
    const auto level = spdlog::level::to_string_view(message.level);
    nlohmann::ordered_json object;
    object["time"] = utc(message.time);
    object["level"] = std::string(level.data(), level.size());
    object["message"] = as_plain_text({message.payload.data(), message.payload.size()});
    const auto add = [&](const char* name, const std::string& value) {
      if (!value.empty()) object[name] = as_plain_text(value);
    };
    add("job", fields.job);
    if (fields.attempt > 0) object["attempt"] = fields.attempt;
    add("owner", fields.owner);
    add("address", fields.address);
    add("trace_id", fields.trace_id);
    add("audit", fields.audit);
    add("outcome", fields.outcome);
    const std::string text = object.dump();
    line.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<JsonLine>(); }

 private:
  /// As 2027-01-31T12:00:00.000Z.
  static std::string utc(spdlog::log_clock::time_point time) {
    const std::time_t seconds = spdlog::log_clock::to_time_t(time);
    std::tm parts{};
    ::gmtime_r(&seconds, &parts);
    std::array<char, 32> text{};
    const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
    const auto since = std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
    const std::string thousandths = std::to_string(1000 + (since % 1000 + 1000) % 1000);
    return std::string(text.data(), length) + "." + thousandths.substr(1) + "Z";
  }
};

/// gRPC logs errors that it also returns, such as a port that is taken. Therefore they are logged for debugging only.
void log_grpc(gpr_log_func_args* args) {
  const auto level = args->severity == GPR_LOG_SEVERITY_ERROR ? spdlog::level::debug : spdlog::level::trace;
  spdlog::log(level, "grpc: {}", args->message);
}

}  // namespace

Expected<void> start_log(const std::string& level, const std::string& format) {
  const auto parsed = spdlog::level::from_str(level);
  if (parsed == spdlog::level::off && level != "off")
    return bad_option("There is no log level '" + level + "'; use trace, debug, info, warn, error or off.");
  if (format != "text" && format != "json")
    return bad_option("There is no format '" + format + "' of the log; use text or json.");
  auto logger = std::make_shared<spdlog::logger>("varimeshd", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_level(parsed);
  auto lines = std::make_unique<spdlog::pattern_formatter>();
  if (format == "json")
    lines->add_flag<JsonLine>('*').set_pattern("%*");
  else
    lines->add_flag<PlainMessage>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %*");
  logger->set_formatter(std::move(lines));
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
  gpr_set_log_function(log_grpc);
#if GOOGLE_PROTOBUF_VERSION < 4022000
  // The parser writes a line for each text that is not UTF-8, in no format and without a limit. The call says it too.
  google::protobuf::SetLogHandler(nullptr);
#endif
  return {};
}

void audit(const std::string& action, const std::string& subject, const std::string& outcome, const LogFields& who) {
  LogFields fields = who;
  fields.audit = action;
  fields.outcome = outcome;
  const LogScope scope(fields);
  spdlog::info("audit: {} {} by {} at {}: {}", action, subject, who.owner.empty() ? "nobody known" : who.owner,
               who.address, outcome);
}

}  // namespace varimesh::server
