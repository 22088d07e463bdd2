#include "core/guard/best_mesh.h"

#include <utility>

namespace varimesh {

double BestMesh::consider(const Guard& guard, const StopToken* stop) {
  const double bound = examine(guard, Certifier::kMinimumGap, stop);
  if (examined_is_better()) keep_examined();
  return bound;
}

double BestMesh::examine(const Guard& guard, double gap, const StopToken* stop) {
  certificates_ = guard.certificates();
  examined_ = guard.coordinates();
  const CertificateSummary summary = certifier_.sharpen(examined_, certificates_, gap, stop);
  examined_uncertified_ = summary.invalid + summary.undecided;
  return examined_bound_ = summary.min_scaled_jacobian_lower_bound;
}

bool BestMesh::examined_is_better() const {
  return examined_uncertified_ < fewest_ || (examined_uncertified_ == fewest_ && examined_bound_ > highest_);
}

void BestMesh::keep_examined() {
  highest_ = examined_bound_;
  fewest_ = examined_uncertified_;
  coordinates_.swap(examined_);
  best_certificates_.swap(certificates_);
}

}  // namespace varimesh
