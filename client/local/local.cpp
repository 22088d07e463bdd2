// The only source file that includes headers of both the client and the server.
#include "client/local/local.h"

#include "core/base/machine_memory.h"
#include "server/engine/geometry_messages.h"
#include "server/log/log.h"
#include "server/server.h"

namespace varimesh::client {
namespace {

class InProcess : public LocalService {
 public:
  explicit InProcess(std::unique_ptr<server::Server> server) : server_(std::move(server)) {}
  std::shared_ptr<grpc::Channel> channel() override { return server_->in_process_channel(); }

 private:
  std::unique_ptr<server::Server> server_;
};

}  // namespace

Expected<std::unique_ptr<LocalService>> LocalService::start(const std::string& folder) {
  // The command itself tells the user what happens, so the service logs errors only.
  if (const auto log = server::start_log("error"); !log) return tl::unexpected(log.error());
  server::ServerOptions options;
  options.engine = server::core_engine();
  options.data = folder;
  options.limits.max_memory_bytes = machine_memory();
  auto started = server::Server::start(std::move(options));
  if (!started) return tl::unexpected(started.error());
  return std::make_unique<InProcess>(std::move(*started));
}

v1::GeometryReport geometry_report(const SlidAndMeasured& done) { return server::to_proto(done); }

}  // namespace varimesh::client
