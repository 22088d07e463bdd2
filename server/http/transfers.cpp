#include "server/http/transfers.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "server/http/listen.h"
#include "server/refusals.h"
#include "server/streams/status.h"

namespace varimesh::server {
namespace {

/// Bytes of a message.
constexpr std::size_t kPiece = std::size_t{256} << 10;

Answer<std::int64_t> offset_of(std::string_view text) {
  std::int64_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (read.ec != std::errc() || read.ptr != text.data() + text.size() || value < 0)
    return bad_request("The offset '" + std::string(text) + "' is no number of bytes.");
  return value;
}

/// What the query of an upload says.
struct Upload {
  v1::UploadHeader header;
  std::int64_t offset = 0;
};

Answer<Upload> upload_of(const HttpExchange& exchange) {
  const auto fields = exchange.query();
  if (!fields) return tl::unexpected(fields.error());
  Upload upload;
  for (const auto& [name, value] : *fields) {
    if (name == "digest") {
      upload.header.set_digest(value);
    } else if (name == "uploadId") {
      upload.header.set_upload_id(value);
    } else if (name == "offset") {
      const auto offset = offset_of(value);
      if (!offset) return tl::unexpected(offset.error());
      upload.offset = *offset;
    } else {
      return unknown_field(name, "digest, uploadId and offset");
    }
  }
  if (upload.header.digest().empty())
    return bad_request("The address needs ?digest=, the SHA-256 of the whole mesh; sha256sum prints it.");
  // Whoever repeats an upload without an id goes on with it.
  if (upload.header.upload_id().empty()) upload.header.set_upload_id(upload.header.digest());
  upload.header.set_size(upload.offset + exchange.size());
  return upload;
}

/// The only result of a job, or the one in the format that the query names.
Answer<v1::StoredMesh> result_of(const HttpExchange& exchange, const v1::Job& job) {
  const auto fields = exchange.query();
  if (!fields) return tl::unexpected(fields.error());
  std::optional<v1::MeshFormat> format;
  for (const auto& [name, value] : *fields) {
    v1::MeshFormat named{};
    if (name != "format") return unknown_field(name, "format");
    if (!v1::MeshFormat_Parse(value, &named))
      return bad_request("There is no format '" + value + "'; write MESH_FORMAT_VTU, for example.");
    format = named;
  }
  std::string formats;
  const v1::StoredMesh* found = nullptr;
  for (const v1::StoredMesh& result : job.results()) {
    if (!format || result.format() == *format) found = &result;
    formats += (formats.empty() ? "" : ", ") + v1::MeshFormat_Name(result.format());
  }
  if (job.results().empty()) return job_without_result(job.name(), v1::JobState_Name(job.state()));
  if (found == nullptr || (!format && job.results_size() > 1))
    return bad_request("Choose one of the job's results with ?format=: " + formats + ".");
  return *found;
}

/// The first byte that the header Range asks for. Other ranges are not known, and the whole is sent, as HTTP allows.
std::optional<std::int64_t> range_of(const HttpExchange& exchange) {
  const std::string range = exchange.header("Range");
  constexpr std::string_view kUnit = "bytes=";
  if (!range.starts_with(kUnit) || !range.ends_with('-')) return std::nullopt;
  const auto offset = offset_of(std::string_view(range).substr(kUnit.size(), range.size() - kUnit.size() - 1));
  return offset ? std::optional(*offset) : std::nullopt;
}

}  // namespace

void receive_mesh(HttpExchange& exchange, v1::MeshService::Stub& meshes) {
  if (const auto expected = exchange.expect(kBytesType); !expected) return exchange.refuse(status(expected.error()));
  const auto upload = upload_of(exchange);
  if (!upload) return exchange.refuse(status(upload.error()));
  grpc::ClientContext context;
  exchange.pass_on(context);
  const auto stream = meshes.SendMesh(&context);
  v1::SendMeshRequest message;
  v1::SendMeshResponse told;
  *message.mutable_header() = upload->header;
  bool goes_on = stream->Write(message) && stream->Read(&told), cut = false;
  std::int64_t offset = upload->offset;
  std::string piece;
  // Each piece waits for the answer to the one before: a call inside this process whose server has ended may otherwise
  // wait for ever.
  while (goes_on && !told.has_mesh() && offset < upload->header.size()) {
    piece.resize(std::min(kPiece, static_cast<std::size_t>(upload->header.size() - offset)));
    const std::size_t got = exchange.read_some(piece.data(), piece.size());
    cut = got < piece.size();  // what came is kept
    piece.resize(got);
    message.mutable_chunk()->set_offset(offset);
    message.mutable_chunk()->set_data(piece);
    offset += static_cast<std::int64_t>(got);
    goes_on = got > 0 && stream->Write(message);
    do goes_on = goes_on && stream->Read(&told);
    while (goes_on && !told.has_mesh() && told.committed_size() < offset);
    if (cut) break;
  }
  if (cut)
    context.TryCancel();
  else
    stream->WritesDone();
  while (goes_on && !cut && !told.has_mesh()) goes_on = stream->Read(&told);
  const grpc::Status status = stream->Finish();
  if (cut)
    return exchange.refuse({grpc::StatusCode::ABORTED,
                            "The body ended early or came too slowly; ask how far the upload has come, and go on from "
                            "there."});
  if (!status.ok()) return exchange.refuse(status);
  exchange.answer(told.mesh());
}

void tell_upload(HttpExchange& exchange, v1::MeshService::Stub& meshes, const std::string& id) {
  const auto upload = upload_of(exchange);
  if (!upload) return exchange.refuse(status(upload.error()));
  v1::QueryUploadRequest request;
  request.set_upload_id(id);
  request.set_digest(upload->header.digest());
  exchange.call(meshes, &v1::MeshService::Stub::QueryUpload, request);
}

void send_result(HttpExchange& exchange, v1::JobService::Stub& jobs, v1::MeshService::Stub& meshes,
                 const std::string& job) {
  v1::GetJobRequest asked;
  asked.set_name(job);
  v1::GetJobResponse known;
  {
    grpc::ClientContext context;
    exchange.pass_on(context);
    if (const grpc::Status status = jobs.GetJob(&context, asked, &known); !status.ok()) return exchange.refuse(status);
  }
  const auto result = result_of(exchange, known.job());
  if (!result) return exchange.refuse(status(result.error()));
  const auto range = range_of(exchange);
  if (range.value_or(-1) >= result->size())
    return exchange.refuse(status(offset_outside_mesh(*range, result->size())), 416,
                           "Content-Range: bytes */" + std::to_string(result->size()) + "\r\n");
  v1::DownloadMeshRequest request;
  request.set_digest(result->digest());
  request.set_offset(range.value_or(0));
  grpc::ClientContext context;
  exchange.pass_on(context);
  const auto reader = meshes.DownloadMesh(&context, request);
  v1::DownloadMeshResponse piece;
  bool begun = false;
  while (reader->Read(&piece)) {
    if (!begun) exchange.begin_bytes(request.offset(), piece.size(), range.has_value(), result->digest());
    begun = true;
    if (exchange.send(piece.chunk().data())) continue;
    context.TryCancel();  // the client is gone; it may ask for the rest
    break;
  }
  const grpc::Status status = reader->Finish();
  if (!begun && status.ok())
    exchange.begin_bytes(request.offset(), result->size(), range.has_value(), result->digest());
  if (!begun && !status.ok()) exchange.refuse(status);
}

}  // namespace varimesh::server
