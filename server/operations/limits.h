// What the server takes before it says no.
#pragma once

#include <chrono>
#include <cstdint>

namespace varimesh::server {

struct Limits {
  std::int64_t max_mesh_bytes = std::int64_t{16} << 30;  ///< Of one mesh.
  int max_pending_jobs = 1000;                           ///< Jobs that wait; more are refused.
  int max_pending_jobs_per_peer = 0;                     ///< Of one address; 0: no limit. So the next three.
  int max_running_jobs_per_peer = 0;                     ///< The others of that address wait.
  int max_watches_per_peer = 1000;                       ///< Open at a time.
  int max_uploads_per_peer = 100;                        ///< Open at a time, calls to Optimise among them.
  int max_ended_jobs = 1000;                             ///< Jobs remembered after their end.
  std::int64_t max_store_bytes = 0;                      ///< Meshes that no job refers to go beyond it; 0: no limit.
  std::chrono::minutes mesh_lifetime{7 * 24 * 60};       ///< Of a mesh that no job refers to.
  std::chrono::minutes compress_after{10};               ///< Since a mesh was last asked for; 0: never.
  std::int64_t reserve_bytes = 0;                        ///< Of disk, left for what the running jobs write.
  std::int64_t max_memory_bytes = 0;                     ///< Of all running jobs together; 0: no limit.
  int threads = 0;                                       ///< The machine's budget; 0: all there are.
  std::chrono::milliseconds checkpoint_pause{5'000};     ///< Between two checkpoints of a running job, at least.
  std::chrono::milliseconds bookmark_interval{10000};    ///< Silence on a watch; the contract promises 15 s.
  std::chrono::milliseconds stalled_reader{25000};       ///< A message that is not taken for so long ends the stream.
};

/// Bytes of mesh in one message: larger ones cost more time and memory.
inline constexpr std::size_t kChunkBytes = 256 * 1024;
/// The largest that is taken.
inline constexpr std::size_t kMaxChunkBytes = 1024 * 1024;

}  // namespace varimesh::server
