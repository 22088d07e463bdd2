#include "client/local/local.h"

#include "client/local/local_meshes.h"
#include "core/base/machine_memory.h"
#include "server/engine/geometry_messages.h"
#include "server/log/log.h"
#include "server/server.h"

namespace varimesh::client {
namespace {

class InProcess : public LocalService {
 public:
  InProcess(std::shared_ptr<LocalMeshes> meshes, std::unique_ptr<server::Server> server)
      : meshes_(std::move(meshes)), server_(std::move(server)) {}
  std::shared_ptr<grpc::Channel> channel() override { return server_->in_process_channel(); }
  std::shared_ptr<MeshExchange> exchange() override { return meshes_; }

 private:
  std::shared_ptr<LocalMeshes> meshes_;  // jobs of the server use it
  std::unique_ptr<server::Server> server_;
};

}  // namespace

Expected<std::unique_ptr<LocalService>> LocalService::start(const std::string& folder) {
  // The command itself tells the user what happens, so the service logs errors only.
  if (const auto log = server::start_log("error"); !log) return tl::unexpected(log.error());
  server::ServerOptions options;
  auto meshes = std::make_shared<LocalMeshes>();
  options.engine = meshes->engine(server::core_engine());
  options.data = folder;
  options.limits.max_memory_bytes = machine_memory();
  auto started = server::Server::start(std::move(options));
  if (!started) return tl::unexpected(started.error());
  return std::make_unique<InProcess>(std::move(meshes), std::move(*started));
}

v1::GeometryReport geometry_report(const SlidAndMeasured& done) { return server::to_proto(done); }

}  // namespace varimesh::client
