// Sets up spdlog and passes the messages of gRPC to it.
#include "server/log.h"

#include <grpc/support/log.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

namespace varimesh::server {
namespace {

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
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
  gpr_set_log_function(log_grpc);
  return {};
}

}  // namespace varimesh::server
