// How many processes a launcher of parallel programs (mpirun, mpiexec, srun) started together with this one.
#pragma once

#include "core/base/error.h"

namespace varimesh::client {

/// An error if a launcher started this process as one of several: each would do the whole work and write the same
/// files. The environment says so. A batch script of Slurm is one process, however many tasks its job has.
Expected<void> check_started_alone();

}  // namespace varimesh::client
