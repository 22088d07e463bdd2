// Jobs whose boundary nodes slide on a CAD model.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/geometry/load.h"
#include "server/engine/mesh_parts.h"
#include "server/isolation/process_engine.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

std::string content_of(const std::string& name) {
  std::ifstream file(std::string(VARIMESH_SOURCE_DIR) + "/tests/cases/geometry/" + name);
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_FALSE(text.str().empty()) << name;
  return text.str();
}

v1::JobSpec spec_for(const Service& service, const std::string& mesh, const std::string& geometry) {
  v1::JobSpec spec = service.spec_for(mesh);
  spec.mutable_geometry()->set_digest(service.upload(geometry));
  return spec;
}

/// The refusal of a job that is not taken.
grpc::Status refusal_of(const Service& service, const v1::JobSpec& spec) {
  v1::Job job;
  grpc::Status status = service.submit("", spec, &job);
  EXPECT_FALSE(status.ok());
  return status;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// echo_engine() that takes geometries, and keeps what it got.
Engine echo_with_geometry(std::string* got) {
  Engine engine = echo_engine();
  engine.check_geometry = [](const v1::Geometry&, const Options&) -> Expected<void> { return {}; };
  engine.run = [got, run = std::move(engine.run)](RunRequest request, const RunHooks& hooks) {
    if (request.geometry && request.cad_file != nullptr) *got = request.cad_file->bytes();
    return run(std::move(request), hooks);
  };
  return engine;
}

TEST(Geometry, IsKeptAsLongAsAJobRefersToIt) {
  std::string got;
  const Service service(echo_with_geometry(&got));
  const v1::JobSpec spec = spec_for(service, "a mesh", "a geometry");
  const v1::Job job = service.wait_for(service.submit(spec).name());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(got, "a geometry");
  const auto remove = [&] {
    grpc::ClientContext context;
    v1::DeleteMeshRequest request;
    request.set_digest(spec.geometry().digest());
    v1::DeleteMeshResponse response;
    return service.meshes->DeleteMesh(&context, request, &response);
  };
  EXPECT_EQ(info_of(remove()).reason(), "MESH_IN_USE");
  grpc::ClientContext context;
  v1::DeleteJobRequest request;
  request.set_name(job.name());
  v1::DeleteJobResponse response;
  EXPECT_TRUE(service.jobs->DeleteJob(&context, request, &response).ok());
  // Nothing refers to it any more, so it is gone or can be deleted.
  EXPECT_NE(info_of(remove()).reason(), "MESH_IN_USE");
  EXPECT_EQ(info_of(refusal_of(service, spec)).reason(), "MESH_NOT_FOUND");
}

TEST(Geometry, IsRefusedWithASentenceIfTheSpecMakesNoSense) {
  std::string got;
  const Service service(echo_with_geometry(&got));
  v1::JobSpec spec = spec_for(service, "a mesh", "a geometry");
  spec.mutable_quality();
  EXPECT_TRUE(has(refusal_of(service, spec).error_message(), "moves nothing"));
  spec.clear_quality();
  spec.mutable_geometry()->set_digest("part.step");
  EXPECT_TRUE(has(refusal_of(service, spec).error_message(), "SHA-256"));
  spec.mutable_geometry()->set_digest(std::string(64, 'a'));
  EXPECT_EQ(info_of(refusal_of(service, spec)).reason(), "MESH_NOT_FOUND");
}

TEST(Geometry, IsRefusedByAServerThatCannotReadIt) {
  const Service in_its_own_process(echo_engine());
  EXPECT_TRUE(has(refusal_of(in_its_own_process, spec_for(in_its_own_process, "a mesh", "a geometry")).error_message(),
                  "runs jobs in its own process"));
  const Service without_plugin(process_engine({.program = find_worker(), .cad_plugin = ""}));
  EXPECT_TRUE(has(refusal_of(without_plugin, spec_for(without_plugin, "a mesh", "a geometry")).error_message(),
                  "installed without OpenCASCADE"));
}

TEST(Geometry, MayBeTheOwnBoundaryOnEveryServer) {
  std::string digest;
  for (const bool in_processes : {false, true}) {
    const Service service(in_processes ? process_engine({.program = find_worker(), .cad_plugin = ""}) : core_engine());
    v1::JobSpec spec = service.spec_for(content_of("bracket_p3.msh"));
    spec.mutable_geometry()->set_slide_on(v1::Geometry::SLIDE_ON_BOUNDARY);
    spec.mutable_geometry()->set_snap(true);
    EXPECT_TRUE(has(refusal_of(service, spec).error_message(), "slide_on boundary cannot be combined"));
    spec.mutable_geometry()->set_snap(false);
    const v1::Job job = service.wait_for(service.submit(spec).name());
    ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
    EXPECT_FALSE(job.metrics().has_geometry());
    // The mesh is optimised with its boundary as it came too, and the slid one is better.
    ASSERT_EQ(job.metrics().slide_trials_size(), 1);
    EXPECT_EQ(job.metrics().slide_trials(0).slide(), v1::SlideTrial::SLIDE_NONE);
    EXPECT_EQ(job.metrics().slide_trials(0).outcome(), v1::SlideTrial::OUTCOME_NO_BETTER);
    if (in_processes) {
      EXPECT_EQ(job.results(0).digest(), digest);
    }
    digest = job.results(0).digest();
  }
}

/// A server that reads CAD files in processes.
class CadJobs : public ::testing::Test {
 protected:
  void SetUp() override {
    if (find_cad_plugin().empty()) GTEST_SKIP() << "VariMesh was built without OpenCASCADE";
  }
  static Service service(const std::string& plugin = find_cad_plugin()) {
    return Service(process_engine({.program = find_worker(), .cad_plugin = plugin}));
  }
  static v1::Job run(const Service& service, const v1::JobSpec& spec) {
    return service.wait_for(service.submit(spec).name());
  }
  /// Expects that the job fails because of its geometry, and that the server then runs another.
  static void expect_failure(const Service& service, const std::string& geometry, const std::string& part) {
    const v1::Job job = run(service, spec_for(service, content_of("bracket_p3.msh"), geometry));
    EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
    EXPECT_EQ(job.error().reason(), "BAD_INPUT");
    EXPECT_TRUE(has(job.error().message(), part)) << job.error().message();
    const v1::Job next = run(service, service.spec_for(content_of("bracket_p3.msh")));
    EXPECT_EQ(next.state(), v1::JOB_STATE_SUCCEEDED) << next.error().message();
    EXPECT_FALSE(next.metrics().has_geometry());
  }
};

TEST_F(CadJobs, SlideBoundaryNodes) {
  const Service service = CadJobs::service();
  v1::JobSpec spec = spec_for(service, content_of("bracket_p3.msh"), content_of("bracket.brep"));
  const v1::Job slid = run(service, spec);
  ASSERT_EQ(slid.state(), v1::JOB_STATE_SUCCEEDED) << slid.error().message();
  const v1::GeometryReport& report = slid.metrics().geometry();
  EXPECT_GT(report.nodes(), 0);
  EXPECT_LT(report.after().rms(), report.before().rms());
  EXPECT_FALSE(report.sentences().empty());
  // The same bits with another number of threads.
  spec.mutable_options()->set_threads(1);
  EXPECT_EQ(run(service, spec).results(0).digest(), slid.results(0).digest());
  spec.mutable_geometry()->set_slide(v1::Geometry::SLIDE_NONE);
  const v1::Job still = run(service, spec);
  EXPECT_EQ(still.metrics().geometry().nodes(), 0);
  EXPECT_EQ(still.metrics().geometry().before().rms(), still.metrics().geometry().after().rms());
}

TEST_F(CadJobs, MoveAllNodesTogether) {
  const Service service = CadJobs::service();
  v1::JobSpec spec = spec_for(service, content_of("bracket_p3.msh"), content_of("bracket.brep"));
  spec.mutable_geometry()->set_tolerance(0.5);
  EXPECT_TRUE(has(refusal_of(service, spec).error_message(), "goes only with slide coupled"));
  spec.mutable_geometry()->set_slide(v1::Geometry::SLIDE_COUPLED);
  const v1::Job slid = run(service, spec);
  ASSERT_EQ(slid.state(), v1::JOB_STATE_SUCCEEDED) << slid.error().message();
  EXPECT_TRUE(std::ranges::any_of(slid.metrics().geometry().sentences(),
                                  [](const std::string& sentence) { return has(sentence, "together"); }));
}

TEST_F(CadJobs, TakeIgesFiles) {
  const Service service = CadJobs::service();
  const v1::Job slid = run(service, spec_for(service, content_of("bracket_p3.msh"), content_of("bracket.igs")));
  ASSERT_EQ(slid.state(), v1::JOB_STATE_SUCCEEDED) << slid.error().message();
  const v1::GeometryReport& report = slid.metrics().geometry();
  EXPECT_GT(report.nodes(), 0);
  EXPECT_LT(report.after().rms(), report.before().rms());
  std::string all;
  for (const std::string& sentence : report.sentences()) all += sentence;
  EXPECT_TRUE(has(all, "13 of 13 surfaces of the mesh matched")) << all;
}

/// A job that draws a model.
v1::JobSpec picture_spec(const Service& service, const std::string& model) {
  v1::JobSpec spec = service.spec_for(model);
  spec.mutable_quality();
  spec.add_outputs(v1::MESH_FORMAT_PARTS);
  return spec;
}

TEST_F(CadJobs, DrawAModelInPlaceOfAMesh) {
  const Service service = CadJobs::service();
  for (const char* name : {"bracket.step", "bracket.igs", "bracket.brep"}) {
    const v1::Job job = run(service, picture_spec(service, content_of(name)));
    ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << name << ": " << job.error().message();
    EXPECT_FALSE(job.metrics().has_after());
    EXPECT_TRUE(has(job.metrics().notes(0), "13 faces and ")) << job.metrics().notes(0);
    const auto picture = read_mesh_parts(service.download(job.results(0).digest()));
    ASSERT_TRUE(picture) << picture.error().sentence;
    EXPECT_EQ(picture->order, 1);
    ASSERT_EQ(picture->blocks.size(), 13U);
    for (std::size_t face = 0; face < picture->blocks.size(); ++face) {
      EXPECT_EQ(picture->blocks[face].shape, Shape::Triangle);
      EXPECT_EQ(picture->blocks[face].entity, static_cast<int>(face) + 1);
    }
  }
}

TEST_F(CadJobs, DrawAModelOnlyIfThatIsAllThatIsWanted) {
  const Service service = CadJobs::service();
  const std::string model = content_of("bracket.step");
  const auto expect_no_mesh = [](const v1::Job& job) {
    EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
    EXPECT_TRUE(has(job.error().message(), "a STEP file, which is a geometry and not a mesh")) << job.error().message();
  };
  v1::JobSpec spec = picture_spec(service, model);
  spec.add_outputs(v1::MESH_FORMAT_CELL_QUALITY);
  expect_no_mesh(run(service, spec));
  spec = picture_spec(service, model);
  spec.clear_quality();
  expect_no_mesh(run(service, spec));
  const Service without_plugin = CadJobs::service("");
  expect_no_mesh(run(without_plugin, picture_spec(without_plugin, model)));
}

TEST_F(CadJobs, DrawNoMeshThatNamesACadFile) {
  const Service service = CadJobs::service();
  const v1::Job job = run(service, picture_spec(service,
                                                "** ISO-10303-21, CASCADE Topology\n*node\n1, 0, 0\n2, 1, 0\n"
                                                "3, 0, 1\n*element, type=CPS3\n1, 1, 2, 3\n"));
  ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
  EXPECT_EQ(job.metrics().mesh().elements(), 1);
  EXPECT_EQ(job.metrics().after().certified().valid(), 1);
}

TEST_F(CadJobs, DrawNoDamagedModel) {
  const Service service = CadJobs::service();
  const std::string model = content_of("bracket.step");
  const v1::Job job = run(service, picture_spec(service, model.substr(0, model.size() / 2)));
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().reason(), "BAD_INPUT");
  EXPECT_TRUE(has(job.error().message(), "The model cannot be used: the STEP file is cut off"))
      << job.error().message();
  EXPECT_EQ(run(service, picture_spec(service, model)).state(), v1::JOB_STATE_SUCCEEDED);
}

struct Bytes : Blob {
  explicit Bytes(std::string content) : content(std::move(content)) {}
  std::string_view bytes() const override { return content; }
  std::string content;
};

/// What an engine makes of the bracket: how the run ended, its notes and its output.
struct Ran {
  bool stopped = false, has_slid = false;
  std::string notes, output;
};

/// @param stops   asked again and again whether to stop
Ran run_engine(bool with_geometry, double time_limit, std::function<bool()> stops) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(content_of("bracket_p3.msh"));
  request.options.threads = 1;
  request.options.time_limit = time_limit;
  if (with_geometry) {
    const int file =
        ::open((std::string(VARIMESH_SOURCE_DIR) + "/tests/cases/geometry/bracket.brep").c_str(), O_RDONLY);
    auto model = geometry::read_model(find_cad_plugin(), file, "The geometry", std::int64_t{2} << 30);
    ::close(file);
    EXPECT_TRUE(model) << model.error().sentence;
    request.model = std::make_shared<geometry::CadModel>(std::move(*model));
    request.geometry.emplace();
  }
  Ran ran;
  RunHooks hooks;
  hooks.control.stop_asked = std::move(stops);
  hooks.given_up = [] { return false; };
  hooks.on_iteration = [](const Iteration&) { return Control::Continue; };
  hooks.on_note = [&](const std::string& note) { ran.notes += note + "\n"; };
  hooks.open_output = [&](v1::MeshFormat) {
    return [&](std::string_view bytes) {
      ran.output += bytes;
      return true;
    };
  };
  const auto outcome = core_engine().run(std::move(request), hooks);
  EXPECT_TRUE(outcome) << outcome.error().sentence;
  ran.stopped = outcome->stopped;
  ran.has_slid = outcome->metrics.has_geometry();
  return ran;
}

TEST_F(CadJobs, CanBeStoppedWhileNodesSlide) {
  int asked = 0;
  const auto after = [&](int most) { return [&asked, most] { return ++asked > most; }; };
  // The mesh has been read when it is asked as often as this.
  const Ran still = run_engine(false, 0, after(0));
  asked = 0;
  run_engine(true, 0, [&] { return ++asked < 0; });
  const int all = asked;
  bool stopped_while_sliding = false;
  for (int most = 0; most < all; most += all / 8 + 1) {
    asked = 0;
    const Ran ran = run_engine(true, 0, after(most));
    EXPECT_TRUE(ran.stopped);
    if (!has(ran.notes, "The run was stopped while boundary nodes slid")) continue;
    stopped_while_sliding = true;
    EXPECT_FALSE(ran.has_slid);
    EXPECT_EQ(ran.output, still.output);
  }
  EXPECT_TRUE(stopped_while_sliding);
}

TEST_F(CadJobs, FailWithASentenceOnADamagedFile) {
  const Service service = CadJobs::service();
  const std::string model = content_of("bracket.brep");
  expect_failure(service, model.substr(0, model.size() / 2), "The geometry cannot be used");
  expect_failure(service, "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('a'),'2;1');", "cut off");
  expect_failure(service, std::string("PK\x03\x04", 4) + std::string(500, 'z'), "The geometry cannot be used");
  expect_failure(service, "", "The geometry cannot be used");
}

TEST_F(CadJobs, FailWithASentenceIfTheReaderCrashesOrLies) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("varimesh_reader_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::filesystem::path plugin = folder / "libvarimesh_opencascade.so", reader = folder / "varimesh_cad_reader";
  std::filesystem::create_symlink(find_cad_plugin(), plugin);
  std::ofstream(reader) << "#!/bin/sh\nkill -SEGV $$\n";
  ::chmod(reader.c_str(), 0700);
  const Service crashing = CadJobs::service(plugin);
  expect_failure(crashing, content_of("bracket.brep"), "crashed while it read it (signal 11)");
  const auto picture = [](const Service& service) {
    return run(service, picture_spec(service, content_of("bracket.brep"))).error().message();
  };
  EXPECT_TRUE(has(picture(crashing), "crashed while it read it (signal 11)"));
  // Three million triangles of one face in well formed bytes, with its three nodes at 0.
  std::string many;
  for (const std::int32_t number : {1, 3, 3'000'000}) many.append(reinterpret_cast<const char*>(&number), 4);
  std::ofstream(folder / "head", std::ios::binary) << many;
  std::ofstream(reader, std::ios::trunc) << "#!/bin/sh\n(cat '" << (folder / "head").string()
                                         << "'; head -c 36000072 /dev/zero) >&3\n";
  EXPECT_TRUE(has(picture(CadJobs::service(plugin)), "its reader ended without a picture of it"));
  // Faces without triangles, and what is no face.
  for (const char* made : {"head -c 4800 /dev/zero", "head -c 4800 /dev/zero | tr '\\0' '\\377'", "true"}) {
    std::ofstream(reader, std::ios::trunc) << "#!/bin/sh\n" << made << " >&3\n";
    EXPECT_TRUE(has(picture(CadJobs::service(plugin)), "its reader ended without a picture of it")) << made;
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace varimesh::server::testing
