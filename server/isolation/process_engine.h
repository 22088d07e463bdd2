// An engine that runs every job in a process of its own: varimesh_worker, which has no files, no network and only the
// memory and time that the job may have.
#pragma once

#include <functional>
#include <string>

#include "server/engine/engine.h"

namespace varimesh::server {

/// Where the plugin that reads CAD files is: geometry::plugin_path(). Empty if it is not installed.
std::string find_cad_plugin();

struct ProcessEngineSettings {
  std::string program;                         ///< The path of varimesh_worker: find_worker().
  int threads = 0;                             ///< The most threads that a run may have. 0: all of the machine's.
  std::string cad_plugin = find_cad_plugin();  ///< What reads CAD files. Empty: jobs have no geometries.
  std::function<void(const std::string& line)> warn = [](const auto&) {
  };                                                      ///< Called with what an operator should know.
  std::function<void(int process)> started = [](int) {};  ///< Called with each process; for tests.
};

/// Where varimesh_worker is: VARIMESH_WORKER, beside this program, or in lib/varimesh. Empty if it is not installed.
std::string find_worker();

/// The engine that uses the numerical library in a process for each run, to the same bytes as core_engine(). If the
/// process ends before the run, the outcome says so (RunOutcome::lost). Otherwise it ends with the run.
Engine process_engine(ProcessEngineSettings settings);

}  // namespace varimesh::server
