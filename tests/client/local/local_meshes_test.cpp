// Meshes and results of the service in this process pass by its store, and are the same as through the calls.
#include "client/local/local_meshes.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/local/local.h"
#include "client/process/temporary_folder.h"
#include "core/base/sha256.h"
#include "core/mesh/connectivity.h"

namespace varimesh::client {
namespace {

std::string case_file(const std::string& name) { return VARIMESH_SOURCE_DIR "/tests/cases/" + name; }

std::string content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

class Stored : public server::Blob {
 public:
  explicit Stored(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

TEST(LocalMeshes, TheEngineReadsWhatTheCommandKeepsAndTheCommandWhatTheEngineWrites) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh";
  const std::string mesh(3'000'000, 'm'), result(2'000'000, 'r');
  std::ofstream(path) << mesh;
  LocalMeshes meshes;
  const auto stands_for_it = meshes.keep(*InputFile::open(path));
  ASSERT_TRUE(stands_for_it);
  std::string read;
  server::Engine inner;
  inner.run = [&](const server::RunRequest& request, const server::RunHooks& hooks) {
    read = request.input->bytes();
    const Sink sink = hooks.open_output(v1::MESH_FORMAT_MSH41);
    EXPECT_TRUE(sink(result.substr(0, 5)) && sink(result.substr(5)));
    return Expected<server::RunOutcome>(server::RunOutcome());
  };
  std::string in_store;
  server::RunHooks hooks;
  hooks.open_output = [&](v1::MeshFormat) {
    return [&](std::string_view bytes) {
      in_store += bytes;
      return true;
    };
  };
  server::RunRequest request;
  request.input = std::make_shared<Stored>(*stands_for_it->read_all());
  ASSERT_TRUE(meshes.engine(inner).run(std::move(request), hooks));
  EXPECT_EQ(read, mesh);
  EXPECT_LT(in_store.size(), 100U);
  const auto file = meshes.find(sha256(in_store));
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(*file->read_all(), result);
  EXPECT_EQ(meshes.find(sha256("another")), nullptr);
}

TEST(LocalMeshes, AnInputThatChangesLaterIsNotShownAsWhatTheJobRead) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh";
  std::ofstream(path) << "before";
  LocalMeshes meshes;
  const auto stands_for_it = meshes.keep(*InputFile::open(path));
  const auto kept = meshes.find(sha256(*stands_for_it->read_all()));
  EXPECT_FALSE(kept->has_changed());
  std::ofstream(path) << "after it";
  EXPECT_TRUE(kept->has_changed());
}

/// Runs a job on a mesh of tests/cases, and returns the bytes of its result.
std::string run_job(const std::string& name, bool passes_by) {
  const TemporaryFolder folder;
  const auto local = LocalService::start(folder.path());
  EXPECT_TRUE(local);
  Settings settings;
  if (passes_by) settings.exchange = (*local)->exchange();
  Client client((*local)->channel(), (*local)->channel(), settings);
  const auto mesh = client.upload_file(case_file(name));
  EXPECT_TRUE(mesh) << mesh.error().sentence;
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(mesh->digest());
  spec.mutable_options()->set_threads(1);
  const auto job = client.submit(spec);
  EXPECT_TRUE(job) << job.error().sentence;
  const auto ended = client.watch(job->name(), 0, [](const v1::JobEvent&) { return true; });
  EXPECT_EQ(ended->state(), v1::JOB_STATE_SUCCEEDED) << ended->error().message();
  const std::string path = folder.path() / "result.msh";
  EXPECT_TRUE(client.download(ended->results(0), path));
  return content(path);
}

TEST(LocalMeshes, TheResultHasTheBytesThatItHasThroughTheCalls) {
  for (const char* name : {"nine_triangles.msh", "sphere_p3.msh"}) {
    const std::string result = run_job(name, true);
    EXPECT_GT(result.size(), 1000U);
    EXPECT_EQ(result, run_job(name, false)) << name;
  }
}

TEST(LocalMeshes, AJobFindsTheFacetsOfItsMeshOnce) {
  const std::int64_t before = facet_searches();
  run_job("sphere_p3.msh", true);
  EXPECT_EQ(facet_searches() - before, 1);
}

}  // namespace
}  // namespace varimesh::client
