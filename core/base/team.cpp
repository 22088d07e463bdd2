#include "core/base/team.h"

#include <oneapi/tbb/global_control.h>

#include <memory>

namespace varimesh {

void ensure_workers(int workers) {
  using Control = oneapi::tbb::global_control;
  static std::mutex mutex;
  static std::unique_ptr<Control> raised;
  static int level = static_cast<int>(std::max(1U, std::thread::hardware_concurrency())) - 1;
  const std::scoped_lock lock(mutex);
  if (workers <= level) return;
  level = workers;
  // If several controls exist, oneTBB uses the smallest value. So the old one is removed first.
  raised.reset();
  raised = std::make_unique<Control>(Control::max_allowed_parallelism, static_cast<std::size_t>(workers) + 1);
}

}  // namespace varimesh
