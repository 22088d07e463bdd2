// Finds the entries of a Nektar++ file by their ids.
#include <algorithm>

#include "core/formats/nektar/file.h"

namespace varimesh::formats {

bool NektarIds::are_consecutive() const {
  for (std::size_t i = 0; i < ids_.size(); ++i)
    if (ids_[i] != std::int64_t(i)) return false;
  return true;
}

bool NektarIds::finish(std::int64_t& twice) {
  if (are_consecutive()) return true;
  for (std::size_t i = 0; i < ids_.size(); ++i) sorted_.emplace_back(ids_[i], std::int32_t(i));
  std::sort(sorted_.begin(), sorted_.end());
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  const auto found = std::adjacent_find(sorted_.begin(), sorted_.end(), same);
  if (found != sorted_.end()) twice = found->first;
  return found == sorted_.end();
}

std::int32_t NektarIds::find(std::int64_t id) const {
  if (sorted_.empty()) return id >= 0 && id < std::int64_t(ids_.size()) ? std::int32_t(id) : -1;
  const auto found = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(id, std::int32_t(-1)));
  return found == sorted_.end() || found->first != id ? -1 : found->second;
}

}  // namespace varimesh::formats
