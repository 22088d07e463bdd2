#include "core/mpi/mpi_ranks.h"

#include <mpi.h>

#include <algorithm>
#include <cstdlib>

namespace varimesh {
namespace {

std::size_t at(int rank) { return static_cast<std::size_t>(rank); }

/// MPI ends the whole run when a call fails (MPI_ERRORS_ARE_FATAL), so no result is looked at.
class MpiRanks : public Ranks {
 public:
  MpiRanks() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &count_);
  }

  int rank() const override { return rank_; }
  int count() const override { return count_; }

  void sum(std::span<std::int64_t> numbers) const override {
    if (count_ > 1) count_meeting();
    in_pieces(numbers.size(), [&](std::size_t first, int size) {
      MPI_Allreduce(MPI_IN_PLACE, numbers.data() + first, size, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    });
  }

  void largest(std::span<double> numbers) const override {
    if (count_ > 1) count_meeting();
    in_pieces(numbers.size(), [&](std::size_t first, int size) {
      MPI_Allreduce(MPI_IN_PLACE, numbers.data() + first, size, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    });
  }

  std::vector<Bytes> exchange(std::vector<Bytes> to) const override {
    std::vector<std::int64_t> sizes(to.size()), coming(to.size());
    std::ranges::transform(to, sizes.begin(), [](const Bytes& bytes) { return std::int64_t(bytes.size()); });
    if (count_ > 1) count_meeting();
    MPI_Alltoall(sizes.data(), 1, MPI_INT64_T, coming.data(), 1, MPI_INT64_T, MPI_COMM_WORLD);
    std::vector<Bytes> came(to.size());
    std::vector<Message> messages;
    for (int other = 0; other < count_; ++other) {
      if (other == rank_) continue;
      came[at(other)].resize(static_cast<std::size_t>(coming[at(other)]));
      messages.push_back({other, to[at(other)], came[at(other)]});
    }
    exchange(messages);
    came[at(rank_)] = std::move(to[at(rank_)]);
    return came;
  }

  void exchange(std::span<const Message> messages) const override {
    std::vector<MPI_Request> requests;
    for (const Message& message : messages)
      in_pieces(message.in.size(), [&](std::size_t first, int size) {
        MPI_Irecv(message.in.data() + first, size, MPI_BYTE, message.rank, 0, MPI_COMM_WORLD, &requests.emplace_back());
      });
    for (const Message& message : messages) {
      count_message(message.out.size());
      in_pieces(message.out.size(), [&](std::size_t first, int size) {
        MPI_Isend(message.out.data() + first, size, MPI_BYTE, message.rank, 0, MPI_COMM_WORLD,
                  &requests.emplace_back());
      });
    }
    MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  }

 private:
  /// MPI counts with int. Pieces of one message arrive in the order in which they were sent.
  template <class Send>
  static void in_pieces(std::size_t size, const Send& send) {
    constexpr std::size_t kMost = std::size_t{1} << 28;
    for (std::size_t first = 0; first < size; first += kMost)
      send(first, static_cast<int>(std::min(kMost, size - first)));
  }

  int rank_ = 0, count_ = 1;
};

}  // namespace

MpiSession::MpiSession() {
  // Threads of a rank compute, and its first thread alone calls MPI.
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  ranks_ = std::make_unique<MpiRanks>();
}

MpiSession::~MpiSession() { MPI_Finalize(); }

void MpiSession::abort(int status) {
  MPI_Abort(MPI_COMM_WORLD, status);
  std::abort();
}

}  // namespace varimesh
