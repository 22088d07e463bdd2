// A map of buckets under a lock.
#include "server/resources/rate.h"

#include <algorithm>
#include <cmath>

namespace varimesh::server {
namespace {

/// With more callers than this, those that have used nothing are forgotten.
constexpr std::size_t kManyCallers = 1000;

}  // namespace

double Rate::used(const Bucket& bucket, Time now) const {
  const double minutes = std::chrono::duration<double, std::ratio<60>>(now - bucket.time).count();
  return std::max(0.0, bucket.used - minutes * most_);
}

int Rate::take(const std::string& caller) {
  if (most_ == 0) return 0;
  const Time now = clock_();
  std::lock_guard lock(mutex_);
  if (buckets_.size() > kManyCallers)
    std::erase_if(buckets_, [&](const auto& entry) { return used(entry.second, now) == 0; });
  Bucket& bucket = buckets_[caller];
  const double before = used(bucket, now);
  const double over = before + 1 - most_;
  if (over > 1e-9) return std::max(1, static_cast<int>(std::ceil(over * 60 / most_)));
  bucket = {before + 1, now};
  return 0;
}

void Rate::give_back(const std::string& caller) {
  std::lock_guard lock(mutex_);
  const auto found = buckets_.find(caller);
  if (found != buckets_.end()) found->second.used = std::max(0.0, found->second.used - 1);
}

}  // namespace varimesh::server
