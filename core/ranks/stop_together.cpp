#include "core/ranks/stop_together.h"

#include <array>

namespace varimesh {

StopToken::Agreement agreement_of(const Ranks& ranks) {
  return [&ranks](StopToken::Reason mine) {
    using enum StopToken::Reason;
    std::array<double, 2> wishes{mine == Asked ? 1.0 : 0.0, mine == TimeLimit ? 1.0 : 0.0};
    ranks.largest(wishes);
    return wishes[0] > 0 ? Asked : wishes[1] > 0 ? TimeLimit : None;
  };
}

}  // namespace varimesh
