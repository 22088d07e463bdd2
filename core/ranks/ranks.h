// Ranks: processes, perhaps on several machines, that work on parts of one mesh and have no memory in common.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <numeric>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/base/error.h"
#include "core/base/exact_sum.h"

namespace varimesh {

/// What a rank has sent to others. Its memory for itself does not count.
struct Traffic {
  std::int64_t messages = 0;  ///< From this rank to another.
  std::int64_t bytes = 0;     ///< In these messages.
  std::int64_t meetings = 0;  ///< Calls for which all ranks wait: sums, extremes, and sizes of what is exchanged.
};

/// The ranks that work together, as one of them sees it.
///
/// All ranks call every function that has to do with others, in the same order, and it returns when all have called it.
/// A rank that fails by itself goes on to the next call of agree(), which tells all ranks of the failure. The results
/// do not depend on how the work is divided.
class Ranks {
 public:
  using Bytes = std::vector<std::byte>;

  Ranks() = default;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  virtual ~Ranks() = default;

  /// From 0 to count() − 1.
  virtual int rank() const = 0;
  virtual int count() const = 0;
  bool is_first() const { return rank() == 0; }

  /// Replaces each number by its sum over all ranks. As many on each rank.
  virtual void sum(std::span<std::int64_t> numbers) const = 0;
  /// Replaces each number by the largest of all ranks. As many on each rank; none is NaN.
  virtual void largest(std::span<double> numbers) const = 0;
  /// Sends to[r] to rank r, and returns what came, by the rank that sent it.
  virtual std::vector<Bytes> exchange(std::vector<Bytes> to) const = 0;
  /// What is sent to another rank and what comes from it, if both know the sizes. At most one for each other rank; the
  /// other rank has the counterpart. Either part may be empty.
  struct Message {
    int rank = 0;
    std::span<const std::byte> out;
    std::span<std::byte> in;
  };
  /// Exchanges these messages. Ranks that have no message for each other do not wait for each other.
  virtual void exchange(std::span<const Message> messages) const = 0;

  /// What this rank has sent so far.
  const Traffic& traffic() const { return traffic_; }

  // What follows is made of these.

  std::int64_t sum(std::int64_t number) const {
    sum(std::span(&number, 1));
    return number;
  }
  /// Exact sums of doubles, rounded once.
  void sum(std::span<ExactSum> sums) const;
  double sum(ExactSum one) const {
    sum(std::span(&one, 1));
    return one.value();
  }
  double largest(double number) const {
    largest(std::span(&number, 1));
    return number;
  }
  double smallest(double number) const { return -largest(-number); }
  /// The same, and whether `mine` is true on a rank, in one message.
  double sum(ExactSum one, bool mine, bool& any) const;
  /// Whether a rank says so: all ranks stop together at the wish of one.
  bool any(bool mine) const { return sum(std::int64_t{mine ? 1 : 0}) > 0; }
  /// The sum over the ranks before this one.
  std::int64_t sum_before(std::int64_t number) const;

  /// The lists of all ranks, one after another in the order of the ranks, on rank 0; an empty one on the others. `T` is
  /// plain data.
  template <class T>
  std::vector<T> gather(const std::vector<T>& part) const {
    std::vector<Bytes> to(static_cast<std::size_t>(count()));
    to[0] = bytes_of(part);
    return joined<T>(exchange(std::move(to)));
  }
  /// The same on all ranks. No rank needs memory for another copy of the lists.
  template <class T>
  std::vector<T> gather_everywhere(const std::vector<T>& part) const {
    static_assert(std::is_trivially_copyable_v<T>);
    std::vector<std::int64_t> sizes(static_cast<std::size_t>(count()));
    sizes[static_cast<std::size_t>(rank())] = static_cast<std::int64_t>(part.size());
    sum(std::span(sizes));
    std::vector<T> all(static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), std::int64_t{0})));
    std::vector<Message> messages;
    std::span<T> rest(all);
    for (int other = 0; other < count(); ++other) {
      const std::span<T> theirs = rest.first(static_cast<std::size_t>(sizes[static_cast<std::size_t>(other)]));
      rest = rest.subspan(theirs.size());
      if (other == rank())
        std::copy(part.begin(), part.end(), theirs.begin());
      else
        messages.push_back({other, std::as_bytes(std::span(part)), std::as_writable_bytes(theirs)});
    }
    exchange(messages);
    return all;
  }
  /// Sends lists to the ranks, and returns those that came, by rank.
  template <class T>
  std::vector<std::vector<T>> exchange_lists(const std::vector<std::vector<T>>& to) const {
    std::vector<Bytes> bytes;
    for (const std::vector<T>& list : to) bytes.push_back(bytes_of(list));
    std::vector<std::vector<T>> lists;
    for (const Bytes& came : exchange(std::move(bytes))) lists.push_back(joined<T>({came}));
    return lists;
  }

  /// Returns the fault of the lowest rank that has one, on all ranks; nothing if no rank has a fault. All ranks stop or
  /// go on together.
  Expected<void> agree(const Expected<void>& mine) const;
  /// Calls work() on this rank, and agrees on how it went. work() returns Expected<void> or nothing, and calls no other
  /// rank. What it throws becomes an error.
  template <class Work>
  Expected<void> together(const Work& work) const {
    Expected<void> mine;
    try {
      if constexpr (std::is_void_v<std::invoke_result_t<Work>>)
        work();
      else
        mine = work();
    } catch (const std::bad_alloc&) {
      mine = bad_input("There is not enough memory for a rank's part of the mesh; use more ranks, on more machines.");
    } catch (const std::exception& error) {
      mine = tl::unexpected<Error>({Error::Kind::Internal, std::string("A rank failed: ") + error.what() + "."});
    }
    return agree(mine);
  }

 protected:
  void count_meeting() const { ++traffic_.meetings; }
  /// A message of no bytes is not sent.
  void count_message(std::size_t bytes) const {
    traffic_.messages += bytes > 0 ? 1 : 0;
    traffic_.bytes += static_cast<std::int64_t>(bytes);
  }

 private:
  template <class T>
  static Bytes bytes_of(const std::vector<T>& list) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto bytes = std::as_bytes(std::span(list));
    return {bytes.begin(), bytes.end()};
  }
  template <class T>
  static std::vector<T> joined(const std::vector<Bytes>& parts) {
    std::size_t size = 0;
    for (const Bytes& part : parts) size += part.size() / sizeof(T);
    std::vector<T> all(size);
    std::size_t at = 0;
    for (const Bytes& part : parts) {
      if (!part.empty()) std::memcpy(all.data() + at, part.data(), part.size());
      at += part.size() / sizeof(T);
    }
    return all;
  }

  mutable Traffic traffic_;  ///< Only the thread that is the rank changes it.
};

/// One rank, which is alone and costs nothing.
const Ranks& one_rank();

/// A rank's share of `count` items that all ranks have: those from `begin` to before `end`. The shares follow one
/// another by rank.
struct RankShare {
  std::size_t begin = 0, end = 0;
};
inline RankShare share_of(std::size_t count, const Ranks& ranks) {
  const auto begin_of = [&](int rank) {
    return count * static_cast<std::size_t>(rank) / static_cast<std::size_t>(ranks.count());
  };
  return {begin_of(ranks.rank()), begin_of(ranks.rank() + 1)};
}

}  // namespace varimesh
