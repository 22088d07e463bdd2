// What a run leaves in the mesh store. A full disk fails no job: what it refuses is tried again until there is room.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/engine/engine.h"
#include "server/meshes/mesh_store.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Waits for room in the store on behalf of one run. One thread at a time.
class Room {
 public:
  /// @param pause     time between two tries
  /// @param given_up  whether what the run leaves is not needed any more
  /// @param tell      called before the first wait
  Room(std::chrono::milliseconds pause, std::function<bool()> given_up, std::function<void()> tell)
      : pause_(pause), given_up_(std::move(given_up)), tell_(std::move(tell)) {}

  /// Waits a moment. Returns false if the run is given up.
  bool wait();
  /// Whether a wait has ended without room.
  bool gave_up() const { return gave_up_; }

  /// Returns the answer of `work`, which is repeated as long as it fails for want of room.
  template <class Work>
  auto await(const Work& work) -> decltype(work()) {
    while (true) {
      auto answer = work();
      if (answer || !may_pass(answer.error()) || !wait()) return answer;
    }
  }
  /// Whether the store was full, and may have room later.
  static bool may_pass(const Failure& failure) { return failure.reason == "STORE_FULL" && failure.retry_seconds > 0; }

 private:
  const std::chrono::milliseconds pause_;
  const std::function<bool()> given_up_;
  const std::function<void()> tell_;
  bool told_ = false, gave_up_ = false;
};

/// Writes the outputs of a run to the mesh store. They are released again unless take() is called.
class Outputs {
 public:
  Outputs(MeshStore& meshes, Room& room) : meshes_(meshes), room_(room) {}
  ~Outputs();
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;

  /// Closes the previous output and opens the next one.
  Sink open(v1::MeshFormat format);
  /// Closes the last output.
  void close();

  /// The last failure of the store, if there was one.
  const std::optional<Failure>& failure() const { return failure_; }
  /// Returns the outputs, with their references.
  std::vector<v1::StoredMesh> take() { return std::exchange(stored_, {}); }

 private:
  bool append(std::string_view bytes);

  MeshStore& meshes_;
  Room& room_;
  std::unique_ptr<BlobWriter> writer_;
  v1::MeshFormat format_ = v1::MESH_FORMAT_UNSPECIFIED;
  std::vector<v1::StoredMesh> stored_;
  std::optional<Failure> failure_;
};

/// Stores the history and returns its digest.
Answer<std::string> store_history(MeshStore& meshes, Room& room, const v1::History& history);

}  // namespace varimesh::server
