// The programs for HDF5 files that one job has.
#pragma once

#include <cerrno>
#include <vector>

#include "core/formats/hdf5/starter.h"
#include "core/process/helper_program.h"
#include "server/isolation/thread_watch.h"

namespace varimesh::server {

/// Starts them for the process of the job, which may start none, and ends them when this object is destroyed.
class Hdf5Programs {
 public:
  explicit Hdf5Programs(ThreadWatch& watch) : watch_(watch) {}
  ~Hdf5Programs() {
    for (const pid_t program : started_) {
      watch_.forget(program);
      end_helper(program, true);
    }
  }
  Hdf5Programs(const Hdf5Programs&) = delete;
  Hdf5Programs& operator=(const Hdf5Programs&) = delete;

  /// `computing`: how many of its threads compute at most. EPERM if the job has had more than any needs.
  formats::Hdf5Program start(const formats::Hdf5Start& how, int computing) {
    constexpr std::size_t kMost = 32;
    if (started_.size() >= kMost) return {-1, -1, EPERM};
    const formats::Hdf5Program program = formats::start_hdf5(how);
    if (program.id <= 0) return program;
    started_.push_back(program.id);
    watch_.add(program.id, computing);
    return program;
  }

 private:
  ThreadWatch& watch_;
  std::vector<pid_t> started_;
};

}  // namespace varimesh::server
