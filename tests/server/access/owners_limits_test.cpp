// How much an owner may store and hold open, whatever the order of the calls.
#include <atomic>
#include <chrono>
#include <limits>
#include <thread>

#include "tests/server/access/owners.h"

namespace varimesh::server::testing {
namespace {

TEST_F(Owners, HaveLimitsOfTheirOwn) {
  gate_.open();
  service_.reset();
  ServerOptions options = options_with(echo_engine());
  options.tokens = (folder_ / "tokens").string();
  options.limits.max_bytes_per_owner = 20;
  options.limits.max_priority = 3;
  service_ = std::make_unique<Service>(std::move(options));
  upload(kAnn, "fifteen bytes..");
  upload(kOperator, "a mesh");
  grpc::ClientContext context;
  context.AddMetadata("authorization", std::string("Bearer ") + kAnn);
  const auto stream = service_->meshes->SendMesh(&context);
  v1::SendMeshRequest request;
  request.mutable_header()->set_digest(sha256("another mesh"));
  request.mutable_header()->set_upload_id("another");
  request.mutable_header()->set_size(12);
  stream->Write(request);
  stream->WritesDone();
  v1::SendMeshResponse response;
  EXPECT_FALSE(stream->Read(&response));
  const auto refused = stream->Finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(info_of(refused).reason(), "OWNER_FULL");

  v1::Job job;
  ASSERT_TRUE(submit(kAnn, sha256("fifteen bytes.."), &job).ok());
  EXPECT_TRUE(watch(kAnn, job.name()).ok());  // its result has the same bytes, which count once
  v1::SubmitJobRequest wanted;
  wanted.mutable_spec()->mutable_mesh()->set_digest(sha256("fifteen bytes.."));
  wanted.mutable_spec()->set_priority(4);
  v1::SubmitJobResponse submitted;
  EXPECT_EQ(info_of(call_as(kAnn, *service_->jobs, &v1::JobService::Stub::SubmitJob, wanted, &submitted)).reason(),
            "BAD_REQUEST");
  wanted.mutable_spec()->mutable_mesh()->set_digest(sha256("a mesh"));
  EXPECT_TRUE(call_as(kOperator, *service_->jobs, &v1::JobService::Stub::SubmitJob, wanted, &submitted).ok())
      << "an admin may choose any priority";
}

/// Each may store 3 MiB.
class OwnersOfThreeMebibytes : public Owners {
 protected:
  void SetUp() override {
    Owners::SetUp();
    gate_.open();
    service_.reset();
    ServerOptions options = options_with(echo_engine());
    options.tokens = (folder_ / "tokens").string();
    options.limits.max_bytes_per_owner = 3 << 20;
    service_ = std::make_unique<Service>(std::move(options));
  }
};

/// Sends a mesh by Optimise, with `announced` as its size, and returns how the stream ends.
grpc::Status optimise(const Service& service, const std::string& token, const std::string& mesh,
                      std::int64_t announced) {
  const auto stub = v1::OptimiseService::NewStub(service.channel);
  grpc::ClientContext context;
  context.AddMetadata("authorization", "Bearer " + token);
  const auto stream = stub->Optimise(&context);
  v1::OptimiseRequest request;
  request.mutable_spec()->set_size(announced);
  stream->Write(request);
  for (std::size_t at = 0; at < mesh.size(); at += 1 << 19) {
    request.mutable_chunk()->set_offset(static_cast<std::int64_t>(at));
    request.mutable_chunk()->set_data(mesh.substr(at, 1 << 19));
    if (!stream->Write(request)) break;
  }
  stream->WritesDone();
  v1::OptimiseResponse response;
  while (stream->Read(&response)) {
  }
  return stream->Finish();
}

TEST_F(OwnersOfThreeMebibytes, CannotPassTheirLimitByOptimise) {
  const std::string large(8 << 20, 'x'), small(1 << 20, 'y');
  EXPECT_EQ(info_of(optimise(*service_, kAnn, large, 0)).reason(), "OWNER_FULL") << "it announces nothing";
  EXPECT_EQ(info_of(optimise(*service_, kAnn, large, 10)).reason(), "BAD_REQUEST") << "it announces too little";
  for (const std::int64_t negative :
       {std::int64_t{-1}, -(std::int64_t{1} << 40), std::numeric_limits<std::int64_t>::min()})
    EXPECT_EQ(info_of(optimise(*service_, kAnn, large, negative)).reason(), "BAD_REQUEST") << negative;
  EXPECT_EQ(info_of(optimise(*service_, kAnn, large, 0)).reason(), "OWNER_FULL") << "the sizes before changed no sum";
  EXPECT_TRUE(optimise(*service_, kAnn, small, 0).ok());
}

TEST_F(OwnersOfThreeMebibytes, CannotPassTheirLimitByParallelStreams) {
  for (int round = 0; round < 2; ++round) {
    std::atomic<int> taken = 0;
    std::vector<std::thread> senders;
    for (int i = 0; i < 12; ++i)
      senders.emplace_back([&, i] {
        const std::string mesh(1 << 20, static_cast<char>('a' + i));
        const auto status = optimise(*service_, kAnn, mesh, i % 2 == 0 ? 0 : 1 << 20);
        if (status.ok()) ++taken;
        EXPECT_TRUE(status.ok() || info_of(status).reason() == "OWNER_FULL") << status.error_message();
      });
    for (std::thread& sender : senders) sender.join();
    EXPECT_LE(taken, 3);
    EXPECT_GE(taken, 1) << "streams that are refused leave room for others";
    for (const std::string& job : list(kAnn, false)) EXPECT_TRUE(remove(kAnn, job).ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // an owner who has too much is counted once a second
  }
}

TEST_F(OwnersOfThreeMebibytes, HaveTheRoomOfCutStreamsAgain) {
  const auto stub = v1::OptimiseService::NewStub(service_->channel);
  for (int i = 0; i < 100; ++i) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", std::string("Bearer ") + kAnn);
    const auto stream = stub->Optimise(&context);
    v1::OptimiseRequest request;
    request.mutable_spec()->set_size(i % 2 == 0 ? 0 : 2 << 20);
    stream->Write(request);
    request.mutable_chunk()->set_data(std::string(1 << 20, static_cast<char>(i)));
    stream->Write(request);
    context.TryCancel();
    stream->Finish();
  }
  const std::string whole(3 << 20, 'w');
  const auto begun = std::chrono::steady_clock::now();
  grpc::Status status;
  do {
    status = optimise(*service_, kAnn, whole, 3 << 20);
  } while (!status.ok() && std::chrono::steady_clock::now() - begun < std::chrono::seconds(10));
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(list(kAnn, false).size(), 1u) << "a mesh of unknown size whose stream is cut is no mesh";
}

TEST_F(Owners, DoNotBlockOthersWithStalledStreams) {
  gate_.open();
  const auto stub = v1::OptimiseService::NewStub(service_->channel);
  constexpr int kMany = 100;  // as many as one owner may have open
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReaderWriter<v1::OptimiseRequest, v1::OptimiseResponse>>> streams;
  v1::OptimiseRequest request;
  request.mutable_spec()->set_size(1 << 20);
  const auto stall = [&] {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    contexts.back()->AddMetadata("authorization", std::string("Bearer ") + kAnn);
    streams.push_back(stub->Optimise(contexts.back().get()));
    streams.back()->Write(request);
  };
  for (int i = 0; i < kMany; ++i) stall();
  const auto more = [&] { return optimise(*service_, kAnn, "a mesh", 6); };
  grpc::Status refused = more();
  for (int i = 0; i < 1000 && refused.ok(); ++i) {
    stall();  // the call before may have had the place of one of the first
    refused = more();
  }
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  const auto begun = std::chrono::steady_clock::now();
  for (int i = 0; i < 20; ++i) upload(kBob, "mesh " + std::to_string(i), std::to_string(i));
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(10));
  for (std::size_t i = 0; i < streams.size(); ++i) {
    contexts[i]->TryCancel();
    streams[i]->Finish();
  }
}

}  // namespace
}  // namespace varimesh::server::testing
