#include "client/local/local.h"

#include <limits>

#include "client/local/local_meshes.h"
#include "core/base/machine_memory.h"
#include "core/geometry/load.h"
#include "core/optimise/device/device_choice.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/layer_messages.h"
#include "server/engine/option_messages.h"
#include "server/isolation/worker_process.h"
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

/// core_engine() for jobs on CAD models too.
server::Engine engine_with_models() {
  server::Engine engine = server::core_engine();
  engine.check_geometry = [](const v1::Geometry& geometry, const Options& options) {
    return server::check(geometry, options);
  };
  engine.run = [run = std::move(engine.run)](server::RunRequest request,
                                             const server::RunHooks& hooks) -> Expected<server::RunOutcome> {
    if (request.cad_file != nullptr) {
      const server::Descriptor file(server::open_read_only(*request.cad_file));
      const StopToken stop(hooks.control.stop_asked);
      try {
        auto model = geometry::read_model(file.number, "The geometry", &stop);
        if (!model) return tl::unexpected(model.error());
        request.model = std::make_shared<const geometry::CadModel>(std::move(*model));
      } catch (const Interrupted&) {
        server::RunOutcome outcome;
        outcome.stopped = true;
        return outcome;
      }
    }
    // The jobs are those of this command, in its own process, so they may have the machine's card.
    server::RunHooks with_card = hooks;
    with_card.control.open_device = open_first_card;
    return run(std::move(request), with_card);
  };
  return engine;
}

}  // namespace

Expected<std::unique_ptr<LocalService>> LocalService::start(const std::string& folder) {
  // The command itself tells the user what happens, so the service logs errors only.
  if (const auto log = server::start_log("error"); !log) return tl::unexpected(log.error());
  server::ServerOptions options;
  auto meshes = std::make_shared<LocalMeshes>();
  options.engine = meshes->engine(engine_with_models());
  options.data = folder;
  options.limits.max_memory_bytes = machine_memory();
  // The jobs are those of one command, which has them all wait.
  options.limits.max_pending_jobs = std::numeric_limits<int>::max();
  auto started = server::Server::start(std::move(options));
  if (!started) return tl::unexpected(started.error());
  return std::make_unique<InProcess>(std::move(meshes), std::move(*started));
}

Expected<GeometryOptions> geometry_options(const v1::Geometry& geometry) {
  auto options = server::options_from(geometry);
  if (!options) return bad_option(options.error().sentence);
  return std::move(*options);
}

Expected<LayerOptions> layer_options(const v1::Layers& layers) {
  auto options = server::options_from(layers);
  if (!options) return bad_option(options.error().sentence);
  return std::move(*options);
}

v1::LayersReport layers_message(const LayerSplitReport& report) { return server::to_proto(report); }

v1::LayersReport layers_message(const GrownLayer& grown) { return server::to_proto(grown); }

}  // namespace varimesh::client
