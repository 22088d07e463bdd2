// The codes, reasons and sentences of all refusals.
#include "server/refusals.h"

#include "core/base/counted.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;

/// After a refusal because the disk is full, a client tries again after 30 s; after other limits, after 5 s; without
/// the database, after 2 s.
constexpr int kDiskRetrySeconds = 30, kLimitRetrySeconds = 5, kDatabaseRetrySeconds = 2;

Refusal refusal(Code code, std::string reason, std::string sentence, std::map<std::string, std::string> metadata = {},
                int retry_seconds = 0) {
  return Refusal(Failure{code, std::move(reason), std::move(sentence), std::move(metadata), retry_seconds});
}

}  // namespace

// ===== requests that make no sense =====

Refusal bad_request(std::string sentence, std::map<std::string, std::string> metadata) {
  return refusal(Code::InvalidArgument, "BAD_REQUEST", std::move(sentence), std::move(metadata));
}

Refusal invalid_option(std::string sentence, std::map<std::string, std::string> metadata) {
  return refusal(Code::InvalidArgument, "BAD_OPTION", std::move(sentence), std::move(metadata));
}

// ===== who calls =====

Refusal token_missing() {
  return refusal(Code::Unauthenticated, "TOKEN_MISSING",
                 "This server asks who calls; give a token (varimesh: --token-file FILE or VARIMESH_TOKEN).");
}

Refusal token_unknown() {
  return refusal(Code::Unauthenticated, "TOKEN_UNKNOWN",
                 "The server does not know this token, or it has expired; ask the server's operator for another one.");
}

Refusal keys_unavailable() {
  return refusal(Code::Unavailable, "KEYS_UNAVAILABLE",
                 "The server does not have the key of this token's issuer yet and is about to fetch it; try again.", {},
                 2);
}

Refusal certificate_nameless() {
  return refusal(
      Code::Unauthenticated, "CERTIFICATE_NAMELESS",
      "The client's certificate has no common name, which would be the owner of its jobs; use a certificate with one, "
      "or give the server --tokens.");
}

Refusal page_without_tokens() {
  return refusal(Code::PermissionDenied, "RIGHT_MISSING",
                 "This server knows its callers by their certificates, which this page cannot show; start the server "
                 "with --tokens to read the page with a token, or use 'varimesh jobs --watch'.",
                 {{"rights", "read"}});
}

Refusal page_only_shows() {
  return refusal(Code::PermissionDenied, "RIGHT_MISSING",
                 "This page can cancel jobs only on a server that asks for tokens; use 'varimesh cancel'.",
                 {{"rights", "cancel"}});
}

Refusal right_missing(const std::string& caller, const std::string& rights, const std::string& method) {
  return refusal(Code::PermissionDenied, "RIGHT_MISSING",
                 "The token of " + caller + " does not have the right to " + rights + ", which " + method +
                     " needs; ask the server's operator for another one.",
                 {{"rights", rights}, {"caller", caller}});
}

// ===== no room =====

Refusal store_full(const std::string& what) {
  return refusal(Code::ResourceExhausted, "STORE_FULL",
                 what + "; free space on the server's disk, or ask the server's operator to do so.", {},
                 kDiskRetrySeconds);
}

Refusal history_too_large() {
  return refusal(Code::ResourceExhausted, "STORE_FULL",
                 "The history has too many iterations to be stored; lower max_iterations.");
}

Refusal queue_full(int pending) {
  return refusal(Code::ResourceExhausted, "QUEUE_FULL",
                 "The queue is full: " + counted(pending, "job is", "jobs are") + " waiting; try again later.", {},
                 kLimitRetrySeconds);
}

Refusal peer_limit(const std::string& peer, int most, const std::string& things) {
  return refusal(Code::ResourceExhausted, "PEER_LIMIT",
                 peer + " already has " + std::to_string(most) + " " + things +
                     ", the most that one caller may have; end some, or try again later.",
                 {{"peer", peer}}, kLimitRetrySeconds);
}

Refusal too_many_submissions(const std::string& peer, int most, int seconds) {
  return refusal(Code::ResourceExhausted, "PEER_LIMIT",
                 peer + " has submitted " + std::to_string(most) +
                     " jobs within a minute, the most that one caller may submit; try again later.",
                 {{"peer", peer}}, seconds);
}

Refusal owner_full(const std::string& owner, std::int64_t held, std::int64_t most) {
  return refusal(Code::ResourceExhausted, "OWNER_FULL",
                 "The meshes and results of " + owner + " have " + std::to_string(held) +
                     " bytes on this server, and may have " + std::to_string(most) +
                     " (its flag --max-bytes-per-owner); delete jobs, and meshes that no job refers to.",
                 {{"held_bytes", std::to_string(held)}, {"max_bytes", std::to_string(most)}});
}

Refusal mesh_too_large(std::int64_t max, std::optional<std::int64_t> size) {
  const std::string limit = std::to_string(max);
  return refusal(Code::ResourceExhausted, "MESH_TOO_LARGE",
                 size ? "The file has " + std::to_string(*size) + " bytes; the server accepts at most " + limit +
                            " (its flag --max-mesh-bytes)."
                      : "The file has more than " + limit +
                            " bytes, the most that the server accepts (its flag --max-mesh-bytes).",
                 {{"max_mesh_bytes", limit}});
}

Refusal mesh_needs_memory(std::int64_t max, std::int64_t needed) {
  const std::string limit = std::to_string(max);
  return refusal(Code::ResourceExhausted, "MESH_TOO_LARGE",
                 "The mesh takes at least " + std::to_string(needed) +
                     " bytes of memory, but the jobs of this server have only " + limit +
                     " together (its flag --max-memory-bytes); use a server with more memory, or a smaller mesh.",
                 {{"max_memory_bytes", limit}});
}

// ===== meshes and uploads =====

Refusal mesh_not_found(const std::string& digest) {
  return refusal(Code::NotFound, "MESH_NOT_FOUND", "The mesh " + digest + " is not in the store; upload it.",
                 {{"digest", digest}});
}

Refusal mesh_missing(const std::string& digest) {
  return refusal(Code::FailedPrecondition, "MESH_NOT_FOUND",
                 "The mesh or geometry " + digest + " is not in the store; upload it and submit the job again.",
                 {{"digest", digest}});
}

Refusal mesh_in_use(const std::string& digest) {
  return refusal(Code::FailedPrecondition, "MESH_IN_USE",
                 "Jobs refer to the mesh or geometry " + digest + "; delete them first.", {{"digest", digest}});
}

Refusal upload_not_found(const std::string& what) {
  return refusal(Code::NotFound, "UPLOAD_NOT_FOUND", what + "; start the upload again from byte 0.");
}

Refusal upload_taken_over() {
  return refusal(Code::Aborted, "UPLOAD_TAKEN_OVER", "Another stream has continued this upload.");
}

Refusal upload_id_used(const std::string& id) {
  return refusal(Code::AlreadyExists, "UPLOAD_ID_USED",
                 "The upload id '" + id + "' belongs to an upload of another file; choose a new id.");
}

Refusal upload_larger_than_declared(std::int64_t size) {
  return refusal(Code::InvalidArgument, "MESH_LARGER_THAN_SAID",
                 "The upload has more than the " + std::to_string(size) +
                     " bytes that its header declares; upload the file again under a new id.");
}

Refusal digest_mismatch(const std::string& received, const std::string& declared) {
  return refusal(Code::InvalidArgument, "DIGEST_MISMATCH",
                 "The received bytes have the SHA-256 " + received + ", but the header declares " + declared +
                     "; upload the file again under a new id.",
                 {{"digest", received}});
}

Refusal chunk_out_of_order(std::int64_t offset, std::int64_t committed) {
  return refusal(Code::OutOfRange, "WRONG_OFFSET",
                 "The chunk begins at byte " + std::to_string(offset) + ", but the server has " +
                     std::to_string(committed) + " bytes of the upload; continue from there.",
                 {{"committed_size", std::to_string(committed)}});
}

Refusal offset_outside_mesh(std::int64_t offset, std::int64_t size) {
  return refusal(
      Code::OutOfRange, "WRONG_OFFSET",
      "The offset " + std::to_string(offset) + " is outside the mesh, which has " + std::to_string(size) + " bytes.",
      {{"size", std::to_string(size)}});
}

// ===== jobs =====

Refusal job_not_found(const std::string& name) {
  return refusal(Code::NotFound, "JOB_NOT_FOUND", "There is no job '" + name + "'; list the jobs to see their names.",
                 {{"job", name}});
}

Refusal job_not_ended(const std::string& name) {
  return refusal(Code::FailedPrecondition, "JOB_NOT_ENDED", name + " has not ended; cancel it first.", {{"job", name}});
}

Refusal job_without_result(const std::string& name, const std::string& state) {
  return refusal(Code::FailedPrecondition, "JOB_NOT_SUCCEEDED", name + " has no result: its state is " + state + ".",
                 {{"job", name}, {"state", state}});
}

Refusal request_id_used(const std::string& request_id, const std::string& job) {
  return refusal(Code::AlreadyExists, "REQUEST_ID_USED",
                 "The request id '" + request_id + "' was already used for " + job +
                     ", which has a different spec; choose a new id.",
                 {{"job", job}});
}

Refusal claim_lost(const std::string& name) {
  return refusal(Code::Aborted, "CLAIM_LOST", "Another worker has taken over " + name + ".", {{"job", name}});
}

Refusal sequence_expired(const std::string& name, std::int64_t after, std::int64_t oldest) {
  return refusal(Code::OutOfRange, "SEQUENCE_EXPIRED",
                 "The server does not have the events of " + name + " that follow number " + std::to_string(after) +
                     "; watch the job from 0.",
                 {{"job", name}, {"oldest_sequence", std::to_string(oldest)}});
}

// ===== the server itself =====

Refusal server_stopping(int retry_seconds) {
  return refusal(Code::Unavailable, "STOPPING", "The server is stopping; try again when it is back.", {},
                 retry_seconds);
}

Refusal store_unavailable() {
  return refusal(Code::Unavailable, "STORE_UNAVAILABLE",
                 "The server cannot reach the database of its jobs at the moment; try again later.", {},
                 kDatabaseRetrySeconds);
}

Refusal meshes_unavailable() {
  return refusal(Code::Unavailable, "STORE_UNAVAILABLE",
                 "The server cannot reach the store of its meshes at the moment; try again later.", {},
                 kDatabaseRetrySeconds);
}

Refusal directory_unusable(std::string sentence) {
  return refusal(Code::Unavailable, "STORE_FULL", std::move(sentence));
}

Refusal data_lost(std::string sentence) { return refusal(Code::DataLoss, "INTERNAL", std::move(sentence)); }

Refusal damaged_mesh(const std::string& digest, const std::string& why) {
  return data_lost("The stored mesh " + digest + " is damaged (" + why +
                   ") and was removed from the store; upload it, or run the job again.");
}

Refusal internal_failure(std::string sentence) { return refusal(Code::Internal, "INTERNAL", std::move(sentence)); }

}  // namespace varimesh::server
