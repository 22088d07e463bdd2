// Every kind of refusal has the code and the reason that its comment promises, and says when to try again.
#include "server/refusals.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

using Code = Failure::Code;

void expect(const Refusal& refusal, Code code, const std::string& reason, int retry_seconds = 0) {
  const Failure& failure = refusal.value();
  EXPECT_EQ(failure.code, code) << reason;
  EXPECT_EQ(failure.reason, reason);
  EXPECT_EQ(failure.retry_seconds, retry_seconds) << reason;
  EXPECT_GT(failure.sentence.size(), 10u) << reason;
  EXPECT_TRUE(failure.sentence.ends_with('.')) << failure.sentence;
}

TEST(Refusals, OfRequestsThatMakeNoSense) {
  expect(bad_request("The id is empty."), Code::InvalidArgument, "BAD_REQUEST");
  expect(invalid_option("The option is unknown.", {{"option", "mu"}}), Code::InvalidArgument, "BAD_OPTION");
}

TEST(Refusals, ForWantOfRoomSayWhenToTryAgain) {
  expect(store_full("The disk is full"), Code::ResourceExhausted, "STORE_FULL", 30);
  expect(history_too_large(), Code::ResourceExhausted, "STORE_FULL");
  expect(queue_full(7), Code::ResourceExhausted, "QUEUE_FULL", 5);
  expect(peer_limit("10.0.0.1", 3, "open watches"), Code::ResourceExhausted, "PEER_LIMIT", 5);
  expect(too_many_submissions("10.0.0.1", 3, 20), Code::ResourceExhausted, "PEER_LIMIT", 20);
  expect(owner_full("ann", 11, 10), Code::ResourceExhausted, "OWNER_FULL");
  expect(mesh_too_large(10, 11), Code::ResourceExhausted, "MESH_TOO_LARGE");
  expect(mesh_too_large(10), Code::ResourceExhausted, "MESH_TOO_LARGE");
  expect(mesh_needs_memory(10, 11), Code::ResourceExhausted, "MESH_TOO_LARGE");
}

TEST(Refusals, OfMeshesAndUploads) {
  expect(mesh_not_found("abc"), Code::NotFound, "MESH_NOT_FOUND");
  expect(mesh_missing("abc"), Code::FailedPrecondition, "MESH_NOT_FOUND");
  expect(upload_not_found("The upload 'u' is not known"), Code::NotFound, "UPLOAD_NOT_FOUND");
  expect(upload_taken_over(), Code::Aborted, "UPLOAD_TAKEN_OVER");
  expect(upload_id_used("u"), Code::AlreadyExists, "UPLOAD_ID_USED");
  expect(upload_larger_than_declared(5), Code::InvalidArgument, "MESH_LARGER_THAN_SAID");
  expect(digest_mismatch("abc", "def"), Code::InvalidArgument, "DIGEST_MISMATCH");
  expect(chunk_out_of_order(9, 4), Code::OutOfRange, "WRONG_OFFSET");
  expect(offset_outside_mesh(9, 4), Code::OutOfRange, "WRONG_OFFSET");
}

TEST(Refusals, OfJobs) {
  expect(job_not_found("j"), Code::NotFound, "JOB_NOT_FOUND");
  expect(job_not_ended("j"), Code::FailedPrecondition, "JOB_NOT_ENDED");
  expect(job_without_result("j", "FAILED"), Code::FailedPrecondition, "JOB_NOT_SUCCEEDED");
  expect(request_id_used("r", "j"), Code::AlreadyExists, "REQUEST_ID_USED");
  expect(claim_lost("j"), Code::Aborted, "CLAIM_LOST");
  expect(sequence_expired("j", 3, 9), Code::OutOfRange, "SEQUENCE_EXPIRED");
}

TEST(Refusals, OfAServerThatCannotServe) {
  expect(server_stopping(2), Code::Unavailable, "STOPPING", 2);
  expect(directory_unusable("The directory cannot be used."), Code::Unavailable, "STORE_FULL");
  expect(data_lost("The bytes cannot be read."), Code::DataLoss, "INTERNAL");
  expect(internal_failure("The writer failed."), Code::Internal, "INTERNAL");
}

TEST(Refusals, TellAClientWhereToContinue) {
  EXPECT_EQ(chunk_out_of_order(9, 4).value().metadata.at("committed_size"), "4");
  EXPECT_EQ(mesh_not_found("abc").value().metadata.at("digest"), "abc");
  EXPECT_EQ(mesh_too_large(10, 11).value().metadata.at("max_mesh_bytes"), "10");
}

}  // namespace
}  // namespace varimesh::server
