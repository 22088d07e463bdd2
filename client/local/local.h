// The whole service inside this process, for commands that are given no --server. They then use the same code as with a
// server, but no network.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "client/library/input_file.h"
#include "core/base/error.h"
#include "core/layers/grow/grow_layer.h"
#include "core/layers/split/split_layers.h"
#include "core/options/geometry_options.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// A server that listens on no address. It is reached through an in-process channel. It takes CAD models, because their
/// reader (varimesh_cad_reader) is a process of its own, and the user of this process knows where they come from.
class LocalService {
 public:
  /// Starts the service. It keeps its meshes below `folder`. Errors: those of server::Server::start().
  static Expected<std::unique_ptr<LocalService>> start(const std::string& folder);
  virtual ~LocalService() = default;
  virtual std::shared_ptr<grpc::Channel> channel() = 0;
  /// For Settings::exchange of the client that uses the channel.
  virtual std::shared_ptr<MeshExchange> exchange() = 0;
};

/// The options of the library for a geometry, for nodes that slide without a job. Errors: BadOption.
Expected<GeometryOptions> geometry_options(const v1::Geometry& geometry);

/// The same for layers that are made without a job, and what came of them as a message. Errors: BadOption.
Expected<LayerOptions> layer_options(const v1::Layers& layers);
v1::LayersReport layers_message(const LayerSplitReport& report);
v1::LayersReport layers_message(const GrownLayer& grown);

}  // namespace varimesh::client
