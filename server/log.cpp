// Sets up spdlog and passes the messages of gRPC to it.
#include "server/log.h"

#include <grpc/support/log.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
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

/// gRPC logs errors that it also returns, such as a port that is taken. Therefore they are logged for debugging only.
void log_grpc(gpr_log_func_args* args) {
  const auto level = args->severity == GPR_LOG_SEVERITY_ERROR ? spdlog::level::debug : spdlog::level::trace;
  spdlog::log(level, "grpc: {}", args->message);
}

}  // namespace

Expected<void> start_log(const std::string& level) {
  const auto parsed = spdlog::level::from_str(level);
  if (parsed == spdlog::level::off && level != "off")
    return bad_option("There is no log level '" + level + "'; use trace, debug, info, warn, error or off.");
  auto logger = std::make_shared<spdlog::logger>("varimeshd", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_level(parsed);
  auto lines = std::make_unique<spdlog::pattern_formatter>();
  lines->add_flag<PlainMessage>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %*");
  logger->set_formatter(std::move(lines));
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
  gpr_set_log_function(log_grpc);
  return {};
}

}  // namespace varimesh::server
