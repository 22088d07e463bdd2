// The halo of a part: items that a rank uses and another rank computes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/ranks/ranks.h"

namespace varimesh {

/// Which items of one or more arrays go from each rank to each other rank, and where they go there. An item is `width`
/// numbers, one after another; item i begins at number i · width of its array. Both ends list the items of a message in
/// the same order, so that no index travels. Items that are sent are never received.
class Halo {
 public:
  using Item = std::uint32_t;

  /// What one rank exchanges with another.
  struct Neighbour {
    struct Items {
      std::vector<Item> send, receive;
    };
    int rank = 0;
    std::vector<Items> arrays;  ///< As many for every neighbour.
  };

  Halo() = default;
  /// Neighbours without items are left out.
  explicit Halo(std::vector<Neighbour> neighbours);

  const std::vector<Neighbour>& neighbours() const { return neighbours_; }
  std::int64_t items_sent() const;
  std::int64_t items_received() const;

  /// Sends and receives the items of all arrays, one message to each neighbour. All ranks call it, with the same
  /// `width`.
  template <class Number>
  void exchange(std::span<Number* const> arrays, std::size_t width, const Ranks& ranks) const {
    std::vector<std::vector<Number>> out(neighbours_.size()), in(neighbours_.size());
    std::vector<Ranks::Message> messages;
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      for (std::size_t a = 0; a < arrays.size(); ++a)
        for (const Item item : neighbours_[n].arrays[a].send)
          out[n].insert(out[n].end(), arrays[a] + item * width, arrays[a] + (item + 1) * width);
      in[n].resize(received_by(neighbours_[n]) * width);
      messages.push_back(
          {neighbours_[n].rank, std::as_bytes(std::span(out[n])), std::as_writable_bytes(std::span(in[n]))});
    }
    ranks.exchange(messages);
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      const Number* from = in[n].data();
      for (std::size_t a = 0; a < arrays.size(); ++a)
        for (const Item item : neighbours_[n].arrays[a].receive) {
          std::memcpy(arrays[a] + item * width, from, width * sizeof(Number));
          from += width;
        }
    }
  }
  /// The same for one array.
  template <class Number>
  void exchange(Number* array, std::size_t width, const Ranks& ranks) const {
    exchange(std::span<Number* const>(&array, 1), width, ranks);
  }

 private:
  static std::size_t received_by(const Neighbour& neighbour);

  std::vector<Neighbour> neighbours_;
};

}  // namespace varimesh
