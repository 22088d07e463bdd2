#include "core/ranks/ranks.h"

#include <algorithm>
#include <array>
#include <tuple>

namespace varimesh {
namespace {

class OneRank : public Ranks {
 public:
  int rank() const override { return 0; }
  int count() const override { return 1; }
  void sum(std::span<std::int64_t>) const override {}
  void largest(std::span<double>) const override {}
  std::vector<Bytes> exchange(std::vector<Bytes> to) const override { return to; }
  void exchange(std::span<const Message>) const override {}
};

}  // namespace

const Ranks& one_rank() {
  static const OneRank one;
  return one;
}

void Ranks::sum(std::span<ExactSum> sums) const {
  std::vector<std::int64_t> numbers;
  for (ExactSum& one : sums) numbers.insert(numbers.end(), one.settled().begin(), one.settled().end());
  sum(std::span(numbers));
  for (std::size_t i = 0; i < sums.size(); ++i) {
    ExactSum::Numbers& own = sums[i].settled();
    std::copy_n(numbers.begin() + static_cast<std::ptrdiff_t>(i * own.size()), own.size(), own.begin());
  }
}

double Ranks::sum(ExactSum one, bool mine, bool& any) const {
  std::array<std::int64_t, std::tuple_size_v<ExactSum::Numbers> + 1> numbers{};
  std::ranges::copy(one.settled(), numbers.begin());
  numbers.back() = mine ? 1 : 0;
  sum(std::span(numbers));
  any = numbers.back() > 0;
  std::copy_n(numbers.begin(), one.settled().size(), one.settled().begin());
  return one.value();
}

std::int64_t Ranks::sum_before(std::int64_t number) const {
  std::vector<std::int64_t> all(static_cast<std::size_t>(count()));
  all[static_cast<std::size_t>(rank())] = number;
  sum(std::span(all));
  std::int64_t before = 0;
  for (int r = 0; r < rank(); ++r) before += all[static_cast<std::size_t>(r)];
  return before;
}

Expected<void> Ranks::agree(const Expected<void>& mine) const {
  const double faulty = largest(mine ? -count() : -rank());
  if (faulty == -count()) return mine;
  // The rank of the first fault tells the others its kind and its sentence.
  std::vector<char> text;
  if (!mine && -faulty == rank()) {
    text.assign(mine.error().sentence.begin(), mine.error().sentence.end());
    text.push_back(static_cast<char>(mine.error().kind));
  }
  text = gather_everywhere(text);
  const auto kind = static_cast<Error::Kind>(text.back());
  text.pop_back();
  return tl::unexpected<Error>({kind, std::string(text.begin(), text.end())});
}

}  // namespace varimesh
