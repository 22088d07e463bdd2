// Large objects: stored in parts, read in ranges.
#include <algorithm>
#include <cerrno>

#include "core/base/io/write_all.h"
#include "server/meshes/disk.h"
#include "server/meshes/read_at.h"
#include "server/meshes/s3/client.h"
#include "server/meshes/s3/request.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// S3 takes at most this many parts of an object.
constexpr std::int64_t kMostParts = 10'000;

/// For steps that only tidy up.
constexpr S3Patience kBriefly{2'000};

std::int64_t part_bytes(std::int64_t size) {
  return std::max(S3Client::kPieceBytes, (size + kMostParts - 1) / kMostParts);
}

}  // namespace

Answer<void> S3Client::put_file(const std::string& key, int file, std::int64_t size, S3Patience patience) {
  if (size > kPieceBytes) return put_parts(key, file, size, patience);
  std::string bytes;
  if (!read_at(file, 0, static_cast<std::size_t>(size), &bytes)) return cannot_store("a file cannot be read");
  return put(key, bytes, patience).map([](const std::string&) {});
}

Answer<void> S3Client::put_parts(const std::string& key, int file, std::int64_t size, S3Patience patience) {
  // An upload that the server has forgotten is begun again, but not for ever.
  for (int attempt = 1;; ++attempt) {
    const auto begun = send({.method = "POST", .key = key_of(key), .query = "uploads="}, patience);
    if (!begun) return tl::unexpected(begun.error());
    const std::string upload = percent_encoded(text_of(begun->body, "UploadId"));
    if (upload.empty()) return internal_failure("The S3 server of the meshes begins no upload in parts.");
    const auto list = send_parts(key, upload, file, size, patience);
    Answer<Response> ended = tl::unexpected(list ? Failure{} : list.error());
    if (list)
      ended = send({.method = "POST", .key = key_of(key), .query = "uploadId=" + upload, .body = *list}, patience);
    // An error may be told behind the status 200, since the server answers before it has put the parts together.
    if (ended && ended->body.find("<Error>") == std::string::npos) return {};
    if (list && is_there(key, size, patience)) return {};
    [[maybe_unused]] const auto given_up =
        send({.method = "DELETE", .key = key_of(key), .query = "uploadId=" + upload}, kBriefly);
    const bool may_pass = ended || ended.error().code == Failure::Code::NotFound;
    if (!may_pass || attempt == 3) return ended ? Answer<void>(meshes_unavailable()) : tl::unexpected(ended.error());
  }
}

Answer<std::string> S3Client::send_parts(const std::string& key, const std::string& upload, int file, std::int64_t size,
                                         S3Patience patience) {
  std::string list = "<CompleteMultipartUpload>", bytes;
  const std::int64_t step = part_bytes(size);
  int number = 0;
  for (std::int64_t offset = 0; offset < size; offset += step) {
    if (!read_at(file, offset, static_cast<std::size_t>(std::min(step, size - offset)), &bytes))
      return cannot_store("a file cannot be read");
    const std::string part = std::to_string(++number);
    const auto sent = send(
        {.method = "PUT", .key = key_of(key), .query = "partNumber=" + part + "&uploadId=" + upload, .body = bytes},
        patience);
    if (!sent) return tl::unexpected(sent.error());
    list += "<Part><PartNumber>" + part + "</PartNumber><ETag>" + sent->tag + "</ETag></Part>";
  }
  return list + "</CompleteMultipartUpload>";
}

bool S3Client::is_there(const std::string& key, std::int64_t size, S3Patience patience) {
  const auto found = list(key, patience);
  return found &&
         std::ranges::any_of(*found, [&](const S3Object& object) { return object.key == key && object.size == size; });
}

Answer<void> S3Client::get_file(const std::string& key, std::int64_t size, int file, S3Patience patience) {
  for (std::int64_t offset = 0; offset < size; offset += kPieceBytes) {
    const auto piece = get(key, offset, std::min(kPieceBytes, size - offset), patience);
    if (!piece) return tl::unexpected(piece.error());
    if (!write_all(file, *piece)) return cannot_store("a file cannot be written");
  }
  return {};
}

}  // namespace varimesh::server
