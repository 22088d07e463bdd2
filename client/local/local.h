// The whole service inside this process, for a command without --server: one code path, no network.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::client {

/// A server that listens nowhere, reached through an in-process channel.
class LocalService {
 public:
  /// Keeps its meshes below `folder`.
  static Expected<std::unique_ptr<LocalService>> start(const std::string& folder);
  virtual ~LocalService() = default;
  virtual std::shared_ptr<grpc::Channel> channel() = 0;
};

}  // namespace varimesh::client
