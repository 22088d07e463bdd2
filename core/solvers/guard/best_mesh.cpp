#include "core/solvers/guard/best_mesh.h"

namespace varimesh {

double BestMesh::consider(const Guard& guard, const Team& team) {
  const double bound = examine(guard, Certifier::kMinimumGap, team);
  if (examined_is_better()) keep_examined();
  return bound;
}

double BestMesh::examine(const Guard& guard, double gap, const Team& team) {
  certificates_ = guard.certificates();
  guard.copy_coordinates(examined_);
  examined_merit_ = merit_of(certifier_.sharpen(examined_, certificates_, gap, team));
  return examined_merit_.smallest;
}

bool BestMesh::examined_is_better() const { return is_better(examined_merit_, merit_, kAskForMinimum); }

void BestMesh::keep_examined() {
  merit_ = examined_merit_;
  coordinates_.swap(examined_);
  best_certificates_.swap(certificates_);
}

}  // namespace varimesh
