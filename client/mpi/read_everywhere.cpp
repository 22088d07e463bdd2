#include "client/mpi/read_everywhere.h"

#include <cstdint>
#include <new>
#include <span>
#include <utility>

#include "client/library/failures.h"
#include "client/library/input_file.h"
#include "core/ranks/to_all.h"

namespace varimesh::client {
namespace {

/// Calls work(), which returns Expected<void>, on this rank, and agrees on how it went.
template <class Work>
Expected<void> with_room(const Ranks& ranks, const Work& work) {
  return ranks.together([&]() -> Expected<void> {
    try {
      return work();
    } catch (const std::bad_alloc&) {
      return bad_input(kNoRoomForMesh);
    }
  });
}

}  // namespace

Expected<std::string> read_everywhere(const std::string& path, const Ranks& ranks) {
  std::string bytes;
  const auto read = with_room(ranks, [&]() -> Expected<void> {
    if (!ranks.is_first()) return {};
    const auto file = InputFile::open(path);
    if (!file) return bad_input(file.error().sentence);
    auto all = file->read_all();
    if (!all) return bad_input(all.error().sentence);
    bytes = std::move(*all);
    return {};
  });
  if (!read) return tl::unexpected(read.error());
  const std::int64_t size = ranks.sum(static_cast<std::int64_t>(bytes.size()));
  const auto room = with_room(ranks, [&]() -> Expected<void> {
    bytes.resize(static_cast<std::size_t>(size));
    return {};
  });
  if (!room) return tl::unexpected(room.error());
  broadcast(std::as_writable_bytes(std::span(bytes)), ranks);
  return bytes;
}

}  // namespace varimesh::client
