// What is there for whom: two owners and an admin on one server.
#include "tests/server/access/owners.h"

namespace varimesh::server::testing {
namespace {

/// An answer without what names the thing that was asked for.
std::string shape(const grpc::Status& status, const std::string& name) {
  std::string text = std::to_string(status.error_code()) + status.error_message() + info_of(status).DebugString();
  for (auto at = text.find(name); at != std::string::npos; at = text.find(name)) text.replace(at, name.size(), "NAME");
  return text;
}

TEST_F(Owners, DoNotSeeEachOthersJobs) {
  const std::string digest = sha256("ann's mesh");
  upload(kAnn, "ann's mesh");
  v1::Job job, other;
  ASSERT_TRUE(submit(kAnn, digest, &job).ok());
  EXPECT_EQ(job.owner(), "ann");
  const std::string& name = job.name();
  const std::string none = "jobs/0123456789abcdef";
  ASSERT_EQ(name.size(), none.size());

  EXPECT_EQ(shape(get(kBob, name, &other), name), shape(get(kBob, none, &other), none));
  EXPECT_EQ(info_of(get(kBob, name, &other)).reason(), "JOB_NOT_FOUND");
  EXPECT_EQ(shape(cancel(kBob, name), name), shape(cancel(kBob, none), none));
  EXPECT_EQ(shape(remove(kBob, name), name), shape(remove(kBob, none), none));
  EXPECT_EQ(shape(watch(kBob, name), name), shape(watch(kBob, none), none));
  EXPECT_TRUE(list(kBob).empty());
  EXPECT_TRUE(list(kBob, false).empty());
  EXPECT_EQ(list(kAnn), std::vector<std::string>{name});
  EXPECT_EQ(list(kOperator), std::vector<std::string>{name});
  ASSERT_TRUE(get(kAnn, name, &other).ok());
  EXPECT_EQ(other.state(), v1::JOB_STATE_RUNNING) << "Bob's cancellation did nothing";
  ASSERT_TRUE(get(kReader, name, &other).ok()) << "Ann's other token";

  gate_.open();
  EXPECT_TRUE(watch(kAnn, name).ok());
  grpc::ClientContext context;
  context.AddMetadata("authorization", std::string("Bearer ") + kBob);
  v1::GetResultRequest request;
  request.set_name(name);
  const auto result = service_->jobs->GetResult(&context, request);
  v1::GetResultResponse piece;
  EXPECT_FALSE(result->Read(&piece));
  EXPECT_EQ(info_of(result->Finish()).reason(), "JOB_NOT_FOUND");
  EXPECT_FALSE(remove(kBob, name).ok());
  EXPECT_TRUE(remove(kOperator, name).ok()) << "an admin may";
}

TEST_F(Owners, GetNothingForADigest) {
  gate_.open();
  const std::string bytes = "ann's mesh", digest = sha256(bytes), none = sha256("nobody's mesh");
  EXPECT_EQ(upload(kAnn, bytes), 0);
  EXPECT_EQ(upload(kAnn, bytes), static_cast<std::int64_t>(bytes.size())) << "Ann has it";
  v1::Job job, other;
  std::string got;
  EXPECT_EQ(shape(submit(kBob, digest, &other), digest), shape(submit(kBob, none, &other), none));
  EXPECT_EQ(info_of(submit(kBob, digest, &other)).reason(), "MESH_NOT_FOUND");
  EXPECT_EQ(shape(download(kBob, digest, &got), digest), shape(download(kBob, none, &got), none));
  EXPECT_EQ(shape(remove_mesh(kBob, digest), digest), shape(remove_mesh(kBob, none), none));
  EXPECT_EQ(query(kBob, "upload", digest), "UPLOAD_NOT_FOUND");
  EXPECT_EQ(query(kAnn, "", digest), "complete");
  EXPECT_EQ(got, "");

  EXPECT_EQ(upload(kBob, bytes), 0) << "Bob must send all bytes, under an upload id that Ann has used";
  ASSERT_TRUE(submit(kBob, digest, &job).ok());
  EXPECT_TRUE(watch(kBob, job.name()).ok());
  EXPECT_TRUE(remove_mesh(kAnn, digest).ok()) << "no job of Ann's refers to it, and Bob's are not there for her";
  EXPECT_EQ(info_of(download(kAnn, digest, &got)).reason(), "MESH_NOT_FOUND");
  EXPECT_TRUE(download(kBob, digest, &got).ok());
  EXPECT_EQ(got, bytes);
  EXPECT_EQ(info_of(remove_mesh(kBob, digest)).reason(), "MESH_IN_USE");
  ASSERT_TRUE(remove(kBob, job.name()).ok());
  EXPECT_TRUE(remove_mesh(kBob, digest).ok());
  EXPECT_EQ(info_of(remove_mesh(kOperator, digest)).reason(), "MESH_NOT_FOUND") << "nobody had it any more";
}

TEST_F(Owners, ResultsBelongToTheOwnerOfTheJob) {
  gate_.open();
  upload(kAnn, "ann's mesh");
  v1::Job job;
  ASSERT_TRUE(submit(kAnn, sha256("ann's mesh"), &job).ok());
  EXPECT_TRUE(watch(kAnn, job.name()).ok());
  ASSERT_TRUE(get(kAnn, job.name(), &job).ok());
  ASSERT_EQ(job.results_size(), 1);
  const std::string digest = job.results(0).digest();
  for (int i = 0; i < 2; ++i) {
    std::string got;
    EXPECT_FALSE(download(kBob, digest, &got).ok());
    EXPECT_EQ(got, "");
    EXPECT_TRUE(download(kAnn, digest, &got).ok());
    EXPECT_TRUE(download(kOperator, digest, &got).ok());
    start();  // the next server knows it too
  }
  v1::Job again;
  EXPECT_FALSE(get(kBob, job.name(), &again).ok());
  EXPECT_TRUE(get(kAnn, job.name(), &again).ok());
}

TEST_F(Owners, DoNotLearnFromADeletedJobThatOthersHaveItsResult) {
  gate_.open();
  // Results with the same bytes: one that Bob has too, and one that is only Ann's.
  const auto answers = [&](bool bob_has_it, bool restarts) {
    const std::string bytes = "mesh " + std::to_string(bob_has_it) + std::to_string(restarts), digest = sha256(bytes);
    std::vector<std::string> jobs;
    v1::Job job;
    for (const char* token : {kAnn, kBob}) {
      if (token == std::string(kBob) && !bob_has_it) continue;
      EXPECT_TRUE(optimise_mesh(token, bytes, &job).ok());
      EXPECT_TRUE(watch(token, job.name()).ok());
      jobs.push_back(job.name());
    }
    if (restarts) start();
    std::string got;
    EXPECT_TRUE(download(kAnn, digest, &got).ok());
    EXPECT_EQ(info_of(remove_mesh(kAnn, digest)).reason(), "MESH_IN_USE");
    EXPECT_TRUE(remove(kAnn, jobs[0]).ok());
    std::string told = shape(download(kAnn, digest, &got), digest) + query(kAnn, "", digest) +
                       shape(remove_mesh(kAnn, digest), digest) + shape(submit(kAnn, digest, &job), digest);
    if (bob_has_it) {
      EXPECT_TRUE(download(kBob, digest, &got).ok());
    }
    return told;
  };
  for (const bool restarts : {false, true}) EXPECT_EQ(answers(true, restarts), answers(false, restarts));
}

TEST_F(Owners, KeepAResultAsLongAsOneOfTheirJobsHasIt) {
  gate_.open();
  v1::Job first, second;
  ASSERT_TRUE(optimise_mesh(kAnn, "a mesh", &first).ok());
  EXPECT_TRUE(watch(kAnn, first.name()).ok());
  ASSERT_TRUE(submit(kAnn, sha256("a mesh"), &second).ok());
  EXPECT_TRUE(watch(kAnn, second.name()).ok());
  std::string got;
  ASSERT_TRUE(remove(kAnn, first.name()).ok());
  EXPECT_TRUE(download(kAnn, sha256("a mesh"), &got).ok());
  EXPECT_EQ(query(kAnn, "", sha256("a mesh")), "complete");
  ASSERT_TRUE(remove(kAnn, second.name()).ok());
  EXPECT_EQ(query(kAnn, "", sha256("a mesh")), "complete") << "she was told that it is there";
}

TEST_F(Owners, KeepTheirUploadsWhenTheServerStartsAgain) {
  upload(kAnn, "ann's mesh");
  upload(kBob, "everybody's mesh");
  upload(kAnn, "everybody's mesh");
  start();
  EXPECT_EQ(query(kAnn, "", sha256("ann's mesh")), "complete");
  EXPECT_EQ(query(kBob, "", sha256("ann's mesh")), "UPLOAD_NOT_FOUND");
  EXPECT_EQ(query(kAnn, "", sha256("everybody's mesh")), "complete");
  EXPECT_EQ(query(kBob, "", sha256("everybody's mesh")), "complete");
}

TEST_F(Owners, HaveRequestIdsOfTheirOwn) {
  upload(kAnn, "a mesh");
  upload(kBob, "another mesh");
  v1::Job of_ann, of_bob, again;
  ASSERT_TRUE(submit(kAnn, sha256("a mesh"), &of_ann, "run 1").ok());
  ASSERT_TRUE(submit(kBob, sha256("another mesh"), &of_bob, "run 1").ok());
  EXPECT_NE(of_ann.name(), of_bob.name());
  ASSERT_TRUE(submit(kAnn, sha256("a mesh"), &again, "run 1").ok());
  EXPECT_EQ(again.name(), of_ann.name());
}

TEST_F(Owners, HaveTheRightsOfTheirTokens) {
  upload(kSubmitter, "a mesh");
  v1::Job job, other;
  ASSERT_TRUE(submit(kSubmitter, sha256("a mesh"), &job).ok());
  EXPECT_EQ(get(kSubmitter, job.name(), &other).error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(watch(kSubmitter, job.name()).error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(cancel(kReader, job.name()).error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(submit(kReader, sha256("a mesh"), &other).error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(info_of(cancel(kReader, job.name())).reason(), "RIGHT_MISSING");
  EXPECT_TRUE(get(kReader, job.name(), &other).ok());
}

TEST_F(Owners, WithoutTheRightToReadGetOnlyAReceipt) {
  gate_.open();
  upload(kAnn, "a mesh");
  v1::Job job, again;
  ASSERT_TRUE(submit(kSubmitter, sha256("a mesh"), &job, "run 1").ok());
  EXPECT_TRUE(watch(kAnn, job.name()).ok());
  ASSERT_TRUE(submit(kAnn, sha256("a mesh"), &again, "run 1").ok());
  EXPECT_EQ(again.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(again.results_size(), 1);
  ASSERT_TRUE(submit(kSubmitter, sha256("a mesh"), &again, "run 1").ok());
  EXPECT_EQ(again.SerializeAsString(), job.SerializeAsString()) << "how the job went is not told";
  EXPECT_EQ(again.state(), v1::JOB_STATE_UNSPECIFIED);
  EXPECT_EQ(again.spec().mesh().digest(), sha256("a mesh"));
  EXPECT_EQ(again.owner(), "ann");
  for (const auto& [token, told] : {std::pair{kSubmitter, false}, {kReader, true}}) {
    v1::GetServerInfoResponse info;
    ASSERT_TRUE(
        call_as(token, *service_->jobs, &v1::JobService::Stub::GetServerInfo, v1::GetServerInfoRequest(), &info).ok());
    EXPECT_EQ(info.has_start_time(), told);
    EXPECT_GT(info.limits().max_mesh_bytes(), 0);
  }
}

TEST_F(Owners, LearnNothingOfOthersFromPageTokens) {
  gate_.open();
  upload(kAnn, "a mesh");
  upload(kBob, "a mesh");
  std::vector<std::string> submitted;
  v1::Job job;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(submit(kBob, sha256("a mesh"), &job).ok());
    ASSERT_TRUE(submit(kAnn, sha256("a mesh"), &job).ok());
    submitted.insert(submitted.begin(), job.name());
  }
  std::vector<std::string> listed;
  std::string token, second;
  for (int i = 0; i < 5; ++i) {
    v1::ListJobsResponse response;
    ASSERT_TRUE(page(kAnn, token, &response).ok());
    ASSERT_EQ(response.jobs_size(), 1);
    listed.push_back(response.jobs(0).name());
    token = response.next_page_token();
    if (i == 1) second = token;
    EXPECT_EQ(token.size(), i < 4 ? 32u : 0u);
    if (i == 2) start();  // the next server goes on with the list
  }
  EXPECT_EQ(listed, submitted);
  v1::ListJobsResponse response;
  EXPECT_TRUE(page(kAnn, second, &response).ok());
  for (const std::string& wrong : {second.substr(1) + second[0], std::string("3"), std::string(32, 'z')})
    EXPECT_EQ(info_of(page(kAnn, wrong, &response)).reason(), "BAD_REQUEST") << wrong;
  EXPECT_EQ(info_of(page(kBob, second, &response)).reason(), "BAD_REQUEST") << "the token is Ann's";
  ASSERT_TRUE(page(kOperator, "", &response).ok());
  EXPECT_EQ(response.next_page_token(), "10") << "who sees all jobs may know how many there are";
}

}  // namespace
}  // namespace varimesh::server::testing
