// Repeats the writes that a full disk refuses.
#include "server/scheduling/outputs.h"

#include <cerrno>
#include <thread>
#include <utility>

#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// Appends the bytes, as soon as there is room. Returns false if they cannot be stored.
bool append_to(BlobWriter& writer, Room& room, std::string_view bytes) {
  while (!writer.append(bytes))
    if ((errno != ENOSPC && errno != EDQUOT) || !room.wait()) return false;
  return true;
}

}  // namespace

bool Room::wait() {
  if (!std::exchange(told_, true)) tell_();
  gave_up_ = gave_up_ || given_up_();
  if (gave_up_) return false;
  std::this_thread::sleep_for(pause_);
  return true;
}

Outputs::~Outputs() {
  for (const v1::StoredMesh& mesh : stored_) meshes_.release(mesh.digest());
}

Sink Outputs::open(v1::MeshFormat format) {
  close();
  auto created = room_.await([&] { return meshes_.create(); });
  if (!created) {
    failure_ = created.error();
    return [](std::string_view) { return false; };
  }
  writer_ = std::move(*created);
  format_ = format;
  return [this](std::string_view bytes) { return append(bytes); };
}

bool Outputs::append(std::string_view bytes) {
  if (append_to(*writer_, room_, bytes)) return true;
  failure_ = store_full("The server's disk has no room for the result").value();
  failure_->retry_seconds = 0;
  return false;
}

void Outputs::close() {
  if (writer_ == nullptr) return;
  // This is not repeated: what the system could not write to the disk may be lost although it says so only once.
  const auto stored = writer_->commit();
  writer_.reset();
  if (!stored) {
    failure_ = stored.error();
    return;
  }
  v1::StoredMesh mesh;
  mesh.set_digest(stored->digest);
  mesh.set_size(stored->size);
  mesh.set_format(format_);
  stored_.push_back(std::move(mesh));
}

Answer<std::string> store_history(MeshStore& meshes, Room& room, const v1::History& history) {
  std::string bytes;
  if (!history.SerializeToString(&bytes)) return history_too_large();
  const auto store = [&]() -> Answer<StoredBytes> {
    auto writer = meshes.create();
    if (!writer) return tl::unexpected(writer.error());
    if (!append_to(**writer, room, bytes)) return internal_failure("The history of the iterations cannot be stored.");
    return (*writer)->commit();
  };
  return room.await(store).map([](const StoredBytes& stored) { return stored.digest; });
}

}  // namespace varimesh::server
