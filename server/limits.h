// The limits of a server: what it accepts before it refuses, and how long it keeps or waits for things.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace varimesh::server {

struct Limits {
  std::int64_t max_mesh_bytes = std::int64_t{16} << 30;  ///< Size of the largest mesh, in bytes.
  int max_pending_jobs = 1000;                           ///< Jobs that may wait. More are refused.
  int max_pending_jobs_per_peer = 0;                ///< Jobs of one address that may wait. 0: no limit (also for the
                                                    ///< next five).
  int max_running_jobs_per_peer = 0;                ///< Jobs of one address that run at a time. The others wait.
  int max_submissions_per_peer = 0;                 ///< Jobs that one address may submit in a minute.
  int max_watches_per_peer = 1000;                  ///< Open watches of one address.
  int max_downloads_per_peer = 100;                 ///< Open downloads of one address, results included.
  int max_uploads_per_peer = 100;                   ///< Open uploads of one address, including calls to Optimise.
  int max_job_iterations = 0;                       ///< Iterations of a job. 0: no limit.
  double max_job_seconds = 0;                       ///< Seconds that a job runs. 0: no limit.
  int max_priority = 100;                           ///< The highest priority of a job.
  int max_ended_jobs = 1000;                        ///< Jobs of an owner that are remembered after their end, and
  std::chrono::minutes min_ended_age{60};           ///< how long every job is remembered, however many there are.
  std::chrono::hours max_ended_age{0};              ///< How long any job is remembered after its end. 0: no limit.
  std::int64_t max_bytes_per_owner = 0;             ///< Size of an owner's meshes and results, in bytes. 0: no limit.
  std::int64_t max_store_bytes = 0;                 ///< Size of the mesh store above which the oldest meshes that no
                                                    ///< job refers to are deleted, in bytes. 0: no limit.
  std::chrono::minutes mesh_lifetime{7 * 24 * 60};  ///< How long a mesh is kept that no job refers to.
  std::chrono::minutes compress_after{10};          ///< Idle time after which a mesh is compressed. 0: never.
  std::int64_t reserve_bytes = 0;                   ///< Disk space kept free for the running jobs, in bytes.
  std::int64_t max_cache_bytes = std::int64_t{4} << 30;  ///< Copies of meshes of a bucket on this server's disk.
  std::int64_t max_memory_bytes = 0;                   ///< Memory of all running jobs together, in bytes. 0: no limit.
  int threads = 0;                                     ///< Threads shared by the running jobs. 0: all of the machine's.
  std::chrono::milliseconds checkpoint_pause{5'000};   ///< Shortest time between two checkpoints of a running job.
  std::chrono::milliseconds lease{30'000};             ///< How long a worker keeps a job without a sign of life.
  std::chrono::milliseconds bookmark_interval{10000};  ///< Silence on a watch after which a bookmark is sent. The
                                                       ///< contract promises 15 s.
  std::chrono::milliseconds handshake_timeout{10'000};  ///< A connection that says nothing is closed after this.
  std::chrono::milliseconds connection_idle{600'000};   ///< A connection without calls is closed after this.
  std::chrono::milliseconds connection_age{3'600'000};  ///< A connection takes no new calls after this; the client
                                                        ///< opens another one. Its open calls go on.
  std::chrono::milliseconds watchdog{0};                ///< A server that does not reach itself for this long ends. 0:
                                                        ///< it goes on.
  std::chrono::milliseconds stalled_reader{25000};      ///< A stream ends if its client takes longer than this to read
                                                        ///< one message.
};

/// Memory that all connections together may use for messages and headers, in bytes.
inline constexpr std::size_t kConnectionMemory = std::size_t{512} << 20;

/// Bytes of a mesh in one message. Larger messages cost more time and memory.
inline constexpr std::size_t kChunkBytes = 256 * 1024;
/// The largest chunk that the server accepts, in bytes.
inline constexpr std::size_t kMaxChunkBytes = 1024 * 1024;

}  // namespace varimesh::server
