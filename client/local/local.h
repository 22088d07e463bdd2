// The whole service inside this process, for commands that are given no --server. They then use the same code as with a
// server, but no network.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "client/library/input_file.h"
#include "core/base/error.h"
#include "core/slide/distance/slide_and_measure.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// A server that listens on no address. It is reached through an in-process channel.
class LocalService {
 public:
  /// Starts the service. It keeps its meshes below `folder`. Errors: those of server::Server::start().
  static Expected<std::unique_ptr<LocalService>> start(const std::string& folder);
  virtual ~LocalService() = default;
  virtual std::shared_ptr<grpc::Channel> channel() = 0;
  /// For Settings::exchange of the client that uses the channel.
  virtual std::shared_ptr<MeshExchange> exchange() = 0;
};

/// What a server's job with a geometry reports, for nodes that slid in this process.
v1::GeometryReport geometry_report(const SlidAndMeasured& done);

}  // namespace varimesh::client
