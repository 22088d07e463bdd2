#include "core/guard/best_mesh.h"

#include <utility>

namespace varimesh {

double BestMesh::consider(const Guard& guard, const StopToken* stop) {
  certificates_ = guard.certificates();
  std::vector<double> coordinates = guard.coordinates();
  const CertificateSummary summary = certifier_.sharpen(coordinates, certificates_, Certifier::kMinimumGap, stop);
  const std::int64_t uncertified = summary.invalid + summary.undecided;
  const double bound = summary.min_scaled_jacobian_lower_bound;
  if (uncertified < fewest_ || (uncertified == fewest_ && bound > highest_)) {
    highest_ = bound;
    fewest_ = uncertified;
    coordinates_ = std::move(coordinates);
    best_certificates_ = certificates_;
  }
  return bound;
}

}  // namespace varimesh
