// Starting and stopping a server, and many clients at once.
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

TEST(Server, GivesTenConcurrentClientsTheResultsOfASingleOne) {
  const Service service(echo_engine(20));
  const std::string mesh(300'000, 'z');
  std::vector<std::thread> clients;
  std::vector<std::string> results(10);
  for (std::size_t i = 0; i < results.size(); ++i)
    clients.emplace_back([&, i] {
      // Each client has its own mesh and its own connection.
      const std::string mine = mesh + std::to_string(i);
      Service own_view = Service(options_with(echo_engine(20)));
      const v1::Job ended = own_view.wait_for(own_view.submit(own_view.spec_for(mine)).name());
      const v1::Job shared = service.wait_for(service.submit(service.spec_for(mine)).name());
      ASSERT_EQ(shared.state(), v1::JOB_STATE_SUCCEEDED);
      EXPECT_EQ(shared.results(0).digest(), ended.results(0).digest());
      results[i] = service.download(shared.results(0).digest());
      EXPECT_EQ(results[i], mine);
    });
  for (std::thread& client : clients) client.join();
}

TEST(Server, StopsWithOpenWatchesAndUploads) {
  Gate gate;
  Service service(echo_engine(1000, [&](int i) {
    if (i == 2) gate.wait();
  }));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  std::vector<std::thread> watchers;
  std::vector<grpc::Status> ends(8);
  std::atomic<int> open = 0;
  for (grpc::Status& end : ends)
    watchers.emplace_back([&] {
      grpc::ClientContext context;
      v1::WatchJobRequest request;
      request.set_name(job.name());
      const auto reader = service.jobs->WatchJob(&context, request);
      v1::WatchJobResponse response;
      reader->Read(&response);
      ++open;
      while (reader->Read(&response)) {
      }
      end = reader->Finish();
    });
  // An upload whose client sends nothing more.
  grpc::ClientContext stalled;
  v1::UploadMeshResponse response;
  const auto writer = service.meshes->UploadMesh(&stalled, &response);
  v1::UploadMeshRequest header;
  header.mutable_header()->set_upload_id("stalled");
  header.mutable_header()->set_digest(std::string(64, 'c'));
  header.mutable_header()->set_size(10);
  ASSERT_TRUE(writer->Write(header));
  while (open < 8) std::this_thread::yield();
  std::thread later([&] { gate.open(); });
  EXPECT_TRUE(service.server->stop(std::chrono::seconds(20)));
  later.join();
  for (std::thread& watcher : watchers) watcher.join();
  for (const grpc::Status& end : ends) EXPECT_EQ(end.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Server, RefusesAnAddressBeyondLoopbackWithoutInsecure) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:0", "example.org:0"}) {
    const auto started = Server::start(options_with(echo_engine(), address));
    ASSERT_FALSE(started) << address;
    EXPECT_EQ(started.error().kind, Error::Kind::BadOption);
    EXPECT_NE(started.error().sentence.find("--insecure"), std::string::npos);
  }
}

TEST(Server, RefusesAPortThatIsTaken) {
  const Service first(echo_engine());
  const auto second = Server::start(options_with(echo_engine(), first.server->address()));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().kind, Error::Kind::Output);
}

TEST(Server, IsHealthyOverTheNetworkAndInProcess) {
  const Service service(echo_engine());
  for (const auto& channel : {service.channel, service.server->in_process_channel()}) {
    grpc::ClientContext context;
    grpc::health::v1::HealthCheckResponse response;
    const auto health = grpc::health::v1::Health::NewStub(channel);
    ASSERT_TRUE(health->Check(&context, grpc::health::v1::HealthCheckRequest(), &response).ok());
    EXPECT_EQ(response.status(), grpc::health::v1::HealthCheckResponse::SERVING);
  }
}

}  // namespace
}  // namespace varimesh::server::testing
