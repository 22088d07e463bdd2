#include "client/process/launcher.h"

#include <array>
#include <charconv>
#include <cstdlib>
#include <string_view>

namespace varimesh::client {
namespace {

/// The number in an environment variable; `otherwise` if there is none.
int number_in(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  if (text == nullptr) return otherwise;
  const std::string_view digits = text;
  int number = otherwise;
  const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return failed == std::errc() && end == digits.data() + digits.size() ? number : otherwise;
}

/// Variables with the number of processes, the innermost launcher's first: mpirun starts its processes within steps of
/// Slurm, so the variables of a step then tell of mpirun's own processes. SLURM_NTASKS would not do. It is also set in
/// a batch script, which runs once.
constexpr std::array kSizes{
    "OMPI_COMM_WORLD_SIZE",  // mpirun of Open MPI
    "MV2_COMM_WORLD_SIZE",   // mpirun_rsh of MVAPICH
    "PMI_SIZE",              // mpiexec of MPICH and of Intel MPI, srun --mpi=pmi2
    "SLURM_STEP_NUM_TASKS",  // srun
};

Error several(const std::string& what) {
  const bool is_step = what.starts_with("SLURM");
  return {Error::Kind::BadOption,
          std::string(is_step ? "srun" : "A launcher such as mpirun") + " started several processes of this command (" +
              what +
              "), and each would do the whole work and write the same files. Start one process, which uses all "
              "processors of its machine" +
              (is_step ? " (srun -n 1)" : " (mpirun -n 1)") +
              ", or use varimesh-mpi, whose processes share the work of one mesh."};
}

}  // namespace

Expected<void> check_started_alone() {
  for (const char* variable : kSizes) {
    const int size = number_in(variable, 0);
    if (size > 1) return tl::unexpected(several(std::string(variable) + " is " + std::to_string(size)));
    if (size == 1) return {};
  }
  // PMIx tells the number only to those that ask its server. Of several processes, one has the rank 0 and may work.
  if (const int rank = number_in("PMIX_RANK", 0); rank > 0)
    return tl::unexpected(several("PMIX_RANK is " + std::to_string(rank)));
  return {};
}

}  // namespace varimesh::client
