#include "core/ranks/halo.h"

#include <utility>

namespace varimesh {
namespace {

std::size_t sent_by(const Halo::Neighbour& neighbour) {
  std::size_t items = 0;
  for (const Halo::Neighbour::Items& of_array : neighbour.arrays) items += of_array.send.size();
  return items;
}

}  // namespace

Halo::Halo(std::vector<Neighbour> neighbours) {
  for (Neighbour& neighbour : neighbours)
    if (sent_by(neighbour) + received_by(neighbour) > 0) neighbours_.push_back(std::move(neighbour));
}

std::size_t Halo::received_by(const Neighbour& neighbour) {
  std::size_t items = 0;
  for (const Neighbour::Items& of_array : neighbour.arrays) items += of_array.receive.size();
  return items;
}

std::int64_t Halo::items_sent() const {
  std::size_t items = 0;
  for (const Neighbour& neighbour : neighbours_) items += sent_by(neighbour);
  return static_cast<std::int64_t>(items);
}

std::int64_t Halo::items_received() const {
  std::size_t items = 0;
  for (const Neighbour& neighbour : neighbours_) items += received_by(neighbour);
  return static_cast<std::int64_t>(items);
}

}  // namespace varimesh
