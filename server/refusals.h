// One function for each kind of refusal, so that the same situation always gets the same code, reason and sentence.
// The comment of each function names the code and the reason.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "server/failure.h"

namespace varimesh::server {

// ===== requests that make no sense =====

/// INVALID_ARGUMENT, BAD_REQUEST.
Refusal bad_request(std::string sentence, std::map<std::string, std::string> metadata = {});
/// INVALID_ARGUMENT, BAD_OPTION.
Refusal invalid_option(std::string sentence, std::map<std::string, std::string> metadata = {});

// ===== who calls =====

/// UNAUTHENTICATED, TOKEN_MISSING.
Refusal token_missing();
/// UNAUTHENTICATED, TOKEN_UNKNOWN.
Refusal token_unknown();
/// UNAVAILABLE, KEYS_UNAVAILABLE: the keys of the issuer of a token are not there yet.
Refusal keys_unavailable();
/// UNAUTHENTICATED, CERTIFICATE_NAMELESS.
Refusal certificate_nameless();
/// PERMISSION_DENIED, RIGHT_MISSING: the live page of a server that knows its callers only by their certificates.
Refusal page_without_tokens();
Refusal page_only_shows();
/// PERMISSION_DENIED, RIGHT_MISSING. `rights`: the names of the rights that the token of `caller` lacks for `method`.
Refusal right_missing(const std::string& caller, const std::string& rights, const std::string& method);

// ===== no room =====

/// RESOURCE_EXHAUSTED, STORE_FULL. `what` is the beginning of the sentence; the remedy is added to it.
Refusal store_full(const std::string& what);
/// RESOURCE_EXHAUSTED, STORE_FULL: a history has too many iterations for one message.
Refusal history_too_large();
/// RESOURCE_EXHAUSTED, QUEUE_FULL. `pending`: the number of jobs that wait.
Refusal queue_full(int pending);
/// RESOURCE_EXHAUSTED, PEER_LIMIT. `most`: how many `things` ("open watches") one owner or one address may have.
Refusal peer_limit(const std::string& peer, int most, const std::string& things);
/// RESOURCE_EXHAUSTED, PEER_LIMIT. `most`: how many jobs the peer may submit in a minute. `seconds`: when it may again.
Refusal too_many_submissions(const std::string& peer, int most, int seconds);
/// RESOURCE_EXHAUSTED, OWNER_FULL: the meshes and results of `owner` have `held` bytes and may have `most`.
Refusal owner_full(const std::string& owner, std::int64_t held, std::int64_t most);
/// RESOURCE_EXHAUSTED, MESH_TOO_LARGE: the mesh takes at least `needed` bytes of memory, but jobs have `max` together.
Refusal mesh_needs_memory(std::int64_t max, std::int64_t needed);
/// RESOURCE_EXHAUSTED, MESH_TOO_LARGE. `max` and `size` are in bytes; `size` is empty if it is not known.
Refusal mesh_too_large(std::int64_t max, std::optional<std::int64_t> size = {});

// ===== meshes and uploads =====

/// NOT_FOUND, MESH_NOT_FOUND.
Refusal mesh_not_found(const std::string& digest);
/// FAILED_PRECONDITION, MESH_NOT_FOUND: a job needs a mesh that is not in the store.
Refusal mesh_missing(const std::string& digest);
/// FAILED_PRECONDITION, MESH_IN_USE: a mesh that jobs refer to cannot be deleted.
Refusal mesh_in_use(const std::string& digest);
/// NOT_FOUND, UPLOAD_NOT_FOUND. `what` is the beginning of the sentence; the remedy is added to it.
Refusal upload_not_found(const std::string& what);
/// ABORTED, UPLOAD_TAKEN_OVER.
Refusal upload_taken_over();
/// ALREADY_EXISTS, UPLOAD_ID_USED.
Refusal upload_id_used(const std::string& id);
/// INVALID_ARGUMENT, MESH_LARGER_THAN_SAID. `size`: the number of bytes in the header.
Refusal upload_larger_than_declared(std::int64_t size);
/// INVALID_ARGUMENT, DIGEST_MISMATCH.
Refusal digest_mismatch(const std::string& received, const std::string& declared);
/// OUT_OF_RANGE, WRONG_OFFSET: a chunk does not follow the `committed` bytes that the server has.
Refusal chunk_out_of_order(std::int64_t offset, std::int64_t committed);
/// OUT_OF_RANGE, WRONG_OFFSET: a download begins outside the mesh, which has `size` bytes.
Refusal offset_outside_mesh(std::int64_t offset, std::int64_t size);

// ===== jobs =====

/// NOT_FOUND, JOB_NOT_FOUND.
Refusal job_not_found(const std::string& name);
/// FAILED_PRECONDITION, JOB_NOT_ENDED.
Refusal job_not_ended(const std::string& name);
/// FAILED_PRECONDITION, JOB_NOT_SUCCEEDED. `state`: the name of the job's state.
Refusal job_without_result(const std::string& name, const std::string& state);
/// ALREADY_EXISTS, REQUEST_ID_USED. `job`: the job that the request id belongs to.
Refusal request_id_used(const std::string& request_id, const std::string& job);
/// ABORTED, CLAIM_LOST.
Refusal claim_lost(const std::string& name);
/// OUT_OF_RANGE, SEQUENCE_EXPIRED. `oldest`: the oldest event after which a watch can continue without a gap.
Refusal sequence_expired(const std::string& name, std::int64_t after, std::int64_t oldest);

// ===== the server itself =====

/// UNAVAILABLE, STOPPING.
Refusal server_stopping(int retry_seconds);
/// UNAVAILABLE, STORE_UNAVAILABLE: the database of the jobs cannot be reached.
Refusal store_unavailable();
/// UNAVAILABLE, STORE_UNAVAILABLE: the bucket of the meshes cannot be reached.
Refusal meshes_unavailable();
/// UNAVAILABLE, STORE_FULL: a directory cannot be used when the server starts.
Refusal directory_unusable(std::string sentence);
/// DATA_LOSS, INTERNAL: stored bytes cannot be read any more.
Refusal data_lost(std::string sentence);
/// A stored mesh whose bytes are lost for the reason `why`.
Refusal damaged_mesh(const std::string& digest, const std::string& why);
/// INTERNAL, INTERNAL.
Refusal internal_failure(std::string sentence);

}  // namespace varimesh::server
