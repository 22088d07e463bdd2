#include "core/base/version.h"

#include <hwy/highway.h>

namespace varimesh {

std::string_view version() { return VARIMESH_VERSION; }

std::string_view vector_instructions() {
  const std::int64_t usable = hwy::SupportedTargets() & HWY_TARGETS;
  return hwy::TargetName(usable & -usable);  // the lowest bit stands for the best instruction set
}

}  // namespace varimesh
