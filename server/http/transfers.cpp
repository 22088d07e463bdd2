#include "server/http/transfers.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <utility>

#include "core/base/sha256.h"
#include "server/api/requests.h"
#include "server/http/listen.h"
#include "server/http/multipart.h"
#include "server/limits.h"
#include "server/refusals.h"
#include "server/streams/status.h"

namespace varimesh::server {
namespace {

/// The fewest bytes that must come within the patience with a client.
constexpr std::size_t kLeast = std::size_t{256} << 10;

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

/// The bytes that the header Range asks for; the whole if there is none, or one that is not understood or has several
/// parts, as HTTP allows. Nothing: the file has no such bytes.
std::optional<ByteRange> range_of(const HttpExchange& exchange, const v1::StoredMesh& file) {
  const ByteRange whole{0, file.size(), false};
  const std::string text = exchange.header("Range"), if_same = exchange.header("If-Range");
  constexpr std::string_view kUnit = "bytes=";
  if (!text.starts_with(kUnit) || (!if_same.empty() && if_same != "\"" + file.digest() + "\"")) return whole;
  const std::string_view range = std::string_view(text).substr(kUnit.size());
  const auto dash = std::min(range.find('-'), range.size());
  const std::string_view from = range.substr(0, dash), to = range.substr(std::min(dash + 1, range.size()));
  const auto first = offset_of(from.empty() ? "0" : from), last = offset_of(to.empty() ? "0" : to);
  if (dash == range.size() || (from.empty() && to.empty()) || !first || !last) return whole;
  if (from.empty()) {  // so many bytes at the end
    if (*last == 0 || file.size() == 0) return std::nullopt;
    return ByteRange{std::max<std::int64_t>(file.size() - *last, 0), file.size(), true};
  }
  if (!to.empty() && *last < *first) return whole;
  if (*first >= file.size()) return std::nullopt;
  return ByteRange{*first, to.empty() ? file.size() : std::min(*last, file.size() - 1) + 1, true};
}

/// Reads the next bytes of a mesh. Returns whether the client is still there.
bool read_piece(HttpExchange& exchange, std::int64_t left, std::string* piece) {
  piece->resize(std::min<std::size_t>(512 * 1024, static_cast<std::size_t>(left)));
  const std::size_t least = std::min(kLeast, piece->size());
  piece->resize(exchange.read_some(piece->data(), piece->size()));
  return piece->size() >= least;
}

/// The job in the first part of a form. The second one is the mesh.
Answer<v1::JobSpec> spec_of(HttpExchange& exchange, Multipart& parts) {
  const auto order = bad_request("The form must have the part spec, which is JSON, and then the part mesh.");
  const auto first = parts.next();
  if (!first) return tl::unexpected(first.error());
  if (*first != "spec") return order;
  std::string text;
  for (;;) {
    const auto piece = parts.read();
    if (!piece) return tl::unexpected(piece.error());
    if (piece->empty()) break;
    text += *piece;
    if (text.size() > kMostSpecBytes)
      return bad_request("The part spec may have " + std::to_string(kMostSpecBytes) + " bytes.");
  }
  v1::JobSpec spec;
  if (const auto read = exchange.read_json(text, &spec); !read) return tl::unexpected(read.error());
  const auto second = parts.next();
  if (!second) return tl::unexpected(second.error());
  if (*second != "mesh") return order;
  return spec;
}

/// Sends bytes of a result.
void send_bytes(HttpExchange& exchange, v1::MeshService::Stub& meshes, const v1::StoredMesh& file,
                const ByteRange& range) {
  v1::DownloadMeshRequest request;
  request.set_digest(file.digest());
  request.set_offset(range.first);
  grpc::ClientContext context;
  exchange.pass_on(context);
  const auto reader = meshes.DownloadMesh(&context, request);
  v1::DownloadMeshResponse piece;
  bool begun = false;
  std::int64_t left = range.end - range.first;
  while (left > 0 && reader->Read(&piece)) {
    if (!begun) exchange.begin_bytes(range, file.size(), file.digest());
    begun = true;
    const std::string_view bytes = std::string_view(piece.chunk().data()).substr(0, static_cast<std::size_t>(left));
    left -= static_cast<std::int64_t>(bytes.size());
    if (!exchange.send(bytes)) break;  // the client is gone; it may ask for the rest
  }
  if (begun) context.TryCancel();
  const grpc::Status status = reader->Finish();
  if (begun) return;
  if (!status.ok()) return exchange.refuse(status);
  exchange.begin_bytes(range, file.size(), file.digest());
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
  std::int64_t offset = upload->offset, written = 0;
  const auto wait = [&] {
    while (goes_on && !told.has_mesh() && told.committed_size() < written) goes_on = stream->Read(&told);
    return goes_on && !told.has_mesh();
  };
  std::string piece;
  // A piece is read while the server stores the one before, and waits for the answer to that: a call inside this
  // process whose server has ended may otherwise wait for ever.
  while (goes_on && !told.has_mesh() && offset < upload->header.size() && !cut) {
    cut = !read_piece(exchange, upload->header.size() - offset, &piece);  // what came is kept
    if (!wait() || piece.empty()) break;
    message.mutable_chunk()->set_offset(offset);
    offset += static_cast<std::int64_t>(piece.size());
    message.mutable_chunk()->set_data(std::move(piece));
    goes_on = stream->Write(message);
    written = offset;
    piece = std::move(*message.mutable_chunk()->mutable_data());
  }
  wait();
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
  const auto range = range_of(exchange, *result);
  if (!range)
    return exchange.refuse(status(offset_outside_mesh(result->size(), result->size())), 416,
                           "Content-Range: bytes */" + std::to_string(result->size()) + "\r\n");
  send_bytes(exchange, meshes, *result, *range);
}

void send_mesh_of(HttpExchange& exchange, v1::MeshService::Stub& meshes, const std::string& job) {
  if (const auto fields = exchange.query(); !fields || !fields->empty())
    return exchange.refuse(status(bad_request("This address has no fields.")));
  v1::DownloadMeshRequest request;
  request.set_job(job);
  grpc::ClientContext context;
  exchange.pass_on(context);
  const auto reader = meshes.DownloadMesh(&context, request);
  v1::DownloadMeshResponse piece;
  bool begun = false, goes_on = true;
  while (goes_on && reader->Read(&piece)) {
    if (!std::exchange(begun, true)) exchange.begin_bytes({0, piece.size(), false}, piece.size(), "");
    goes_on = exchange.send(piece.chunk().data());
  }
  if (!goes_on) context.TryCancel();  // the client is gone
  const grpc::Status status = reader->Finish();
  if (begun) return;
  if (!status.ok()) return exchange.refuse(status);
  exchange.answer_nothing();
}

void receive_job(HttpExchange& exchange, v1::OptimiseService::Stub& optimise, const std::string& request_id) {
  const auto expected = exchange.expect(kFormType);
  Multipart parts(exchange);
  v1::OptimiseRequest message;
  auto spec = expected ? spec_of(exchange, parts) : tl::unexpected(expected.error());
  if (!spec) return exchange.refuse(status(spec.error()));
  const std::string digest = spec->mesh().digest();
  spec->mutable_mesh()->clear_digest();
  *message.mutable_spec()->mutable_spec() = std::move(*spec);
  message.mutable_spec()->set_request_id(request_id);
  grpc::ClientContext context;
  exchange.pass_on(context);
  const auto stream = optimise.Optimise(&context);
  Sha256 hash;
  std::int64_t offset = 0;
  bool goes_on = stream->Write(message);
  Answer<std::string_view> piece;
  while (goes_on && (piece = parts.read()) && !piece->empty()) {
    if (!digest.empty()) hash.update(*piece);
    message.mutable_chunk()->set_offset(offset);
    message.mutable_chunk()->set_data(piece->data(), piece->size());
    offset += static_cast<std::int64_t>(piece->size());
    goes_on = stream->Write(message);
  }
  Answer<void> good;
  if (!piece) good = tl::unexpected(piece.error());
  if (good && goes_on) good = parts.end();
  if (const std::string sent = digest.empty() ? "" : hash.finish(); good && goes_on && sent != digest)
    good = digest_mismatch(sent, digest);
  if (!good) {
    context.TryCancel();  // no job is made of it
    stream->Finish();
    return exchange.refuse(status(good.error()));
  }
  stream->WritesDone();
  v1::OptimiseResponse told;
  if (!stream->Read(&told) || !told.has_accepted()) return exchange.refuse(stream->Finish());
  context.TryCancel();  // the job goes on
  stream->Finish();
  v1::SubmitJobResponse submitted;
  *submitted.mutable_job() = std::move(*told.mutable_accepted());
  exchange.answer(submitted);
}

}  // namespace varimesh::server
