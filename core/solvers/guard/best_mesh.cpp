#include "core/solvers/guard/best_mesh.h"

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
  examined_merit_ = merit_of(certifier_.sharpen(examined_, certificates_, gap, stop));
  return examined_merit_.smallest;
}

bool BestMesh::examined_is_better() const { return is_better(examined_merit_, merit_, kAskForMinimum); }

void BestMesh::keep_examined() {
  merit_ = examined_merit_;
  coordinates_.swap(examined_);
  best_certificates_.swap(certificates_);
}

}  // namespace varimesh
