// The processes that mpirun or srun started, as ranks. Only this room includes mpi.h.
#pragma once

#include <memory>

#include "core/ranks/ranks.h"

namespace varimesh {

/// Begins and ends the use of MPI in this process. At most one at a time, and only one in the life of a process.
class MpiSession {
 public:
  MpiSession();
  MpiSession(const MpiSession&) = delete;
  MpiSession& operator=(const MpiSession&) = delete;
  ~MpiSession();

  const Ranks& ranks() const { return *ranks_; }

  /// Ends all ranks at once, with this exit status, if this rank can go on no more.
  [[noreturn]] static void abort(int status);

 private:
  std::unique_ptr<Ranks> ranks_;
};

}  // namespace varimesh
