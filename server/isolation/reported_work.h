// What the process of a job says that its kernels have done.
#pragma once

#include <chrono>

#include "core/base/work_meter.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// Adds it to the meter of the run, which may be null. A report is dropped if it cannot be true together with those
/// before, because one hostile mesh must not spoil the metrics of the server.
///
/// @param began since when the process computes
/// @param threads the most that it may use
inline void add_reported(const worker::KernelWork& report, std::chrono::steady_clock::time_point began, int threads,
                         WorkMeter* meter) {
  constexpr double kMostPerSecond = 1e12;  // of one thread: three times what the fastest processors do
  const double most = threads * (1 + std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
  if (meter == nullptr) return;
  const KernelWork before = meter->kernels();
  const bool is_possible = report.seconds() >= 0 && before.seconds + report.seconds() <= most &&
                           report.operations() >= 0 && before.operations + report.operations() <= kMostPerSecond * most;
  if (is_possible) meter->add_kernels({report.operations(), report.seconds()});
}

}  // namespace varimesh::server
