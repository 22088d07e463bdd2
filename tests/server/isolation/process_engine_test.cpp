// Runs in a process of their own, compared with runs in this one.
#include "server/isolation/process_engine.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "core/formats/formats.h"
#include "server/isolation/reported_work.h"
#include "server/isolation/worker_process.h"
#include "tests/core/support/meshes.h"

namespace varimesh::server {
namespace {

class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

std::string mesh_of(const std::string& name) {
  std::ifstream file(std::string(VARIMESH_SOURCE_DIR) + "/tests/cases/" + name);
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_FALSE(text.str().empty()) << name;
  return text.str();
}

/// Everything that a run gives its caller, except what depends on the time.
struct Told {
  std::vector<std::string> outputs;
  std::vector<v1::MeshFormat> formats;
  std::vector<int> iterations;
  std::vector<std::string> notes;
  std::string checkpoint;
  int checkpoint_at = 0;
  std::int64_t least = 0, most = 0, admitted = 0;
};

/// A run with hooks that record what they are told.
struct Trial {
  RunRequest request;
  RunHooks hooks;
  Told told;

  Trial(const Trial&) = delete;  // the hooks point to it
  explicit Trial(std::string mesh) {
    request.input = std::make_shared<Bytes>(std::move(mesh));
    request.options.threads = 2;
    hooks.control.stop_asked = [] { return false; };
    hooks.control.threads = [] { return 2; };
    hooks.given_up = [] { return false; };
    hooks.on_iteration = [this](const Iteration& iteration) {
      told.iterations.push_back(iteration.number);
      return Control::Continue;
    };
    hooks.on_note = [this](const std::string& note) { told.notes.push_back(note); };
    hooks.admit_reading = [this](std::int64_t least, std::int64_t most) -> Expected<bool> {
      told.least = least;
      told.most = most;
      return true;
    };
    hooks.admit = [this](std::int64_t bytes) -> Expected<bool> {
      told.admitted = bytes;
      return true;
    };
    hooks.open_output = [this](v1::MeshFormat format) -> Sink {
      told.formats.push_back(format);
      told.outputs.emplace_back();
      return [this](std::string_view bytes) {
        told.outputs.back() += bytes;
        return true;
      };
    };
    hooks.control.save_checkpoint = [this](const Iteration& iteration, const WriteCheckpoint& write) {
      told.checkpoint.clear();
      told.checkpoint_at = iteration.number;
      EXPECT_TRUE(write([&](std::string_view bytes) {
        told.checkpoint += bytes;
        return true;
      }));
    };
  }

  Expected<RunOutcome> run(const Engine& engine) { return engine.run(request, hooks); }
};

Engine in_processes(std::function<void(int)> started = [](int) {}) {
  const std::string program = find_worker();
  EXPECT_FALSE(program.empty()) << "VARIMESH_WORKER names it";
  return process_engine({.program = program, .started = std::move(started)});
}

std::string without_times(RunOutcome outcome) {
  outcome.metrics.clear_seconds();
  for (v1::Iteration& iteration : *outcome.history.mutable_iterations()) iteration.clear_seconds();
  return outcome.metrics.DebugString() + outcome.history.DebugString();
}

TEST(ProcessEngine, GivesTheSameBytesAsARunInThisProcess) {
  for (const char* name : {"nine_triangles.msh", "cylinder_p2.msh", "annulus_p3.msh"}) {
    SCOPED_TRACE(name);
    Trial here(mesh_of(name)), there(mesh_of(name));
    for (Trial* run : {&here, &there})
      run->request.outputs = {v1::MESH_FORMAT_UNSPECIFIED, v1::MESH_FORMAT_VTU, v1::MESH_FORMAT_PARTS};
    WorkMeter meter_here([](const Work&) {}), meter_there([](const Work&) {});
    here.hooks.control.meter = &meter_here;
    there.hooks.control.meter = &meter_there;
    const auto one = here.run(core_engine()), other = there.run(in_processes());
    ASSERT_TRUE(one && other);
    EXPECT_EQ(other->lost, "");
    EXPECT_EQ(without_times(*one), without_times(*other));
    EXPECT_GT(here.told.iterations.size(), 0U);
    EXPECT_EQ(here.told.outputs.size(), 3U);
    EXPECT_EQ(here.told.outputs, there.told.outputs);
    EXPECT_EQ(here.told.formats, there.told.formats);
    EXPECT_EQ(here.told.iterations, there.told.iterations);
    EXPECT_EQ(here.told.notes, there.told.notes);
    EXPECT_EQ(here.told.most, there.told.most);
    EXPECT_EQ(here.told.admitted, there.told.admitted);
    EXPECT_GT(meter_here.kernels().operations, 1e4);
    EXPECT_EQ(meter_here.kernels().operations, meter_there.kernels().operations) << "the process tells its own";
    EXPECT_GT(meter_there.kernels().seconds, 0);
  }
}

TEST(ProcessEngine, DropsReportsOfKernelsThatCannotBeTrue) {
  WorkMeter meter([](const Work&) {});
  const auto report = [&](double operations, double seconds) {
    worker::KernelWork work;
    work.set_operations(operations);
    work.set_seconds(seconds);
    add_reported(work, std::chrono::steady_clock::now() - std::chrono::seconds(10), 2, &meter);
  };
  const double none = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double operations : {-1.0, 1e15, none, infinity}) report(operations, 1);
  for (const double seconds : {-1.0, 40.0, none, infinity}) report(1e9, seconds);
  EXPECT_EQ(meter.kernels().operations, 0);
  EXPECT_EQ(meter.kernels().seconds, 0);
  report(1e11, 19);
  EXPECT_EQ(meter.kernels().operations, 1e11);
  EXPECT_EQ(meter.kernels().seconds, 19);
  // Two threads have had 22 seconds at most, a second each for what the process did before.
  for (int i = 0; i < 10; ++i) report(1e9, 2);
  EXPECT_LE(meter.kernels().seconds, 23);
}

TEST(ProcessEngine, JudgesAMesh) {
  Trial here(mesh_of("disc_p4.msh")), there(mesh_of("disc_p4.msh"));
  for (Trial* run : {&here, &there}) run->request.quality.emplace().set_diagnose(true);
  const auto one = here.run(core_engine()), other = there.run(in_processes());
  ASSERT_TRUE(one && other);
  EXPECT_EQ(without_times(*one), without_times(*other));
  EXPECT_EQ(here.told.outputs, there.told.outputs);
}

TEST(ProcessEngine, TellsWhatIsWrongWithTheMesh) {
  Trial run("this is no mesh");
  const auto outcome = run.run(in_processes());
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().kind, Error::Kind::BadInput);
  EXPECT_EQ(outcome.error().sentence, Trial("this is no mesh").run(core_engine()).error().sentence);
  Trial refused(mesh_of("nine_triangles.msh"));
  refused.hooks.admit = [](std::int64_t) -> Expected<bool> { return bad_input("There is no room."); };
  EXPECT_EQ(refused.run(in_processes()).error().sentence, "There is no room.");
  Trial waits(mesh_of("nine_triangles.msh"));
  waits.hooks.admit = [](std::int64_t) -> Expected<bool> { return false; };
  const auto stopped = waits.run(in_processes());
  ASSERT_TRUE(stopped);
  EXPECT_TRUE(stopped->stopped);
}

/// So many elements that patches of untangling need more than the room that the run has.
std::string tangled_mesh() {
  HighOrderMesh mesh =
      varimesh::testing::grid(varimesh::testing::Filling::Tetrahedra, {4, 4, 4}, 4, varimesh::testing::bent(3));
  varimesh::testing::shake(mesh, 0.06, 1);
  std::string bytes;
  EXPECT_TRUE(formats::write(mesh, formats::Format::Msh22, [&](auto part) {
    bytes += part;
    return true;
  }));
  return bytes;
}

TEST(ProcessEngine, LendsARunMemoryForUntangling) {
  const std::string mesh = tangled_mesh();
  std::int64_t lent = 0, most = 0;
  const auto lend = [&](Trial& run, std::int64_t limit) {
    run.request.options.until = Until::Valid;
    run.hooks.control.spare_memory = {[&lent, &most, limit](std::int64_t bytes) {
                                        const std::int64_t some = std::min(bytes, limit);
                                        lent += some;
                                        most = std::max(most, lent);
                                        return some;
                                      },
                                      [&lent](std::int64_t bytes) { lent -= bytes; }};
  };
  Trial with(mesh), without(mesh);
  lend(with, std::int64_t{1} << 40);
  ASSERT_TRUE(with.run(in_processes()));
  EXPECT_GT(most, 0);
  EXPECT_EQ(lent, 0) << "all of it is given back";
  lend(without, 0);
  ASSERT_TRUE(without.run(in_processes()));
  EXPECT_EQ(with.told.outputs, without.told.outputs);
}

TEST(ProcessEngine, GoesOnFromACheckpointToTheSameBytes) {
  const auto newton = [](Trial& run) { run.request.options.method = Method::Newton; };
  Trial whole(mesh_of("circle_p5.msh"));
  newton(whole);
  const auto expected = whole.run(core_engine());
  ASSERT_TRUE(expected);
  ASSERT_GT(expected->metrics.iterations(), 3);
  Trial first(mesh_of("circle_p5.msh"));
  newton(first);
  first.hooks.control.checkpoint_due = [](const Iteration& iteration) { return iteration.number == 2; };
  first.hooks.on_iteration = [](const Iteration& iteration) {
    return iteration.number == 2 ? Control::Stop : Control::Continue;
  };
  const auto stopped = first.run(in_processes());
  ASSERT_TRUE(stopped);
  EXPECT_TRUE(stopped->stopped);
  EXPECT_EQ(first.told.checkpoint_at, 2);
  EXPECT_EQ(first.told.outputs.size(), 1U) << "the best mesh so far";
  Trial second(mesh_of("circle_p5.msh"));
  newton(second);
  second.hooks.control.checkpoint = first.told.checkpoint;
  const auto resumed = second.run(in_processes());
  ASSERT_TRUE(resumed);
  EXPECT_EQ(second.told.iterations.front(), 3);
  EXPECT_EQ(second.told.outputs, whole.told.outputs);
}

TEST(ProcessEngine, StopsAtOnceWhenAsked) {
  Trial run(mesh_of("circle_p5.msh"));
  run.request.options.tolerance = 1e-15;
  run.request.options.method = Method::Sweeps;
  run.request.options.max_iterations = 100'000;
  std::atomic<bool> stop = false;
  run.hooks.on_iteration = [&](const Iteration& iteration) {
    stop = iteration.number >= 3;
    return Control::Continue;
  };
  run.hooks.control.stop_asked = [&] { return stop.load(); };
  const auto outcome = run.run(in_processes());
  ASSERT_TRUE(outcome);
  EXPECT_TRUE(outcome->stopped);
  EXPECT_EQ(run.told.outputs.size(), 1U);
  run.hooks.given_up = [&] { return stop.load(); };
  run.told = {};
  stop = false;
  ASSERT_TRUE(run.run(in_processes()));
  EXPECT_TRUE(run.told.outputs.empty()) << "nobody needs them";
}

TEST(ProcessEngine, StopsWritingWhenTheStoreIsFull) {
  Trial run(mesh_of("nine_triangles.msh"));
  run.hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return false; }; };
  run.request.outputs = {v1::MESH_FORMAT_MSH22, v1::MESH_FORMAT_VTU};
  const auto outcome = run.run(in_processes());
  EXPECT_TRUE(!outcome || outcome->lost.empty());
}

TEST(ProcessEngine, TakesWhatTheProcessHasSaidBeforeItEnded) {
  // The server is busy until the process has said everything and ended, and has something to tell it then.
  Trial run(mesh_of("nine_triangles.msh"));
  std::atomic<int> process = 0;
  std::atomic<bool> stops = false;
  const auto open = run.hooks.open_output;
  run.hooks.open_output = [&](v1::MeshFormat format) {
    siginfo_t ended{};
    ::waitid(P_PID, static_cast<id_t>(process), &ended, WEXITED | WNOWAIT);
    stops = true;
    return open(format);
  };
  run.hooks.given_up = [&] { return stops.load(); };
  const auto outcome = run.run(in_processes([&](int id) { process = id; }));
  ASSERT_TRUE(outcome);
  EXPECT_TRUE(stops);
  EXPECT_EQ(outcome->lost, "");
  EXPECT_FALSE(outcome->stopped);
  Trial here(mesh_of("nine_triangles.msh"));
  ASSERT_TRUE(here.run(core_engine()));
  EXPECT_EQ(run.told.outputs, here.told.outputs);
}

TEST(ProcessEngine, SurvivesTheEndOfTheProcess) {
  for (const auto& [signal, sentence] :
       {std::pair{SIGKILL, "was killed, perhaps because the machine has no memory left"},
        std::pair{SIGSEGV, "crashed (signal 11)"}, std::pair{SIGBUS, "crashed (signal 7)"},
        std::pair{SIGXCPU, "used more processor time than its time limit allows"}}) {
    std::atomic<int> process = 0;
    Trial run(mesh_of("nine_triangles.msh"));
    run.hooks.on_iteration = [&](const Iteration&) {
      ::kill(process, signal);
      return Control::Continue;
    };
    const auto outcome = run.run(in_processes([&](int id) { process = id; }));
    ASSERT_TRUE(outcome);
    EXPECT_EQ(outcome->lost, sentence);
  }
  const Engine none = process_engine({.program = "/nowhere/varimesh_worker"});
  const auto outcome = Trial(mesh_of("nine_triangles.msh")).run(none);
  ASSERT_TRUE(outcome);
  EXPECT_NE(outcome->lost.find("could not be started"), std::string::npos);
  const auto other = Trial(mesh_of("nine_triangles.msh")).run(process_engine({.program = "/bin/true"}));
  ASSERT_TRUE(other);
  EXPECT_EQ(other->lost, "ended by itself with status 0") << "it is another program";
}

TEST(ProcessEngine, LetsASignalToAllProcessesPass) {
  std::atomic<int> process = 0;
  Trial run(mesh_of("nine_triangles.msh"));
  run.hooks.on_iteration = [&](const Iteration&) {
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) ::kill(process, signal);
    return Control::Continue;
  };
  const auto outcome = run.run(in_processes([&](int id) { process = id; }));
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->lost, "") << "the server decides when a job ends";
}

TEST(ProcessEngine, PassesAnExceptionOfAHookOnAndEndsTheProcess) {
  std::atomic<int> process = 0;
  Trial run(mesh_of("nine_triangles.msh"));
  run.hooks.on_iteration = [](const Iteration&) -> Control { throw std::runtime_error("out of luck"); };
  EXPECT_THROW((void)run.run(in_processes([&](int id) { process = id; })), std::runtime_error);
  EXPECT_EQ(::kill(process, 0), -1) << "it was waited for";
}

TEST(WorkerProcess, HasNoMoreMemoryThanItMay) {
  std::atomic<int> process = 0;
  Trial run(mesh_of("circle_p5.msh"));
  Engine engine = in_processes([&](int id) { process = id; });
  run.hooks.on_iteration = [&](const Iteration& iteration) {
    // Less than it has already.
    rlimit limits{};
    EXPECT_EQ(::prlimit(process, RLIMIT_AS, nullptr, &limits), 0);
    EXPECT_NE(limits.rlim_cur, RLIM_INFINITY);
    if (iteration.number == 1) {
      limits.rlim_cur = 1 << 20;
      EXPECT_EQ(::prlimit(process, RLIMIT_AS, &limits, nullptr), 0);
    }
    return Control::Continue;
  };
  const auto outcome = run.run(engine);
  const std::string why = outcome ? outcome->lost : outcome.error().sentence;
  EXPECT_NE(why, "") << "a run cannot go on without memory";
}

TEST(WorkerProcess, HasNoMoreProcessorTimeThanItMay) {
  for (const bool limited : {false, true}) {
    std::atomic<int> process = 0;
    Trial run(mesh_of("circle_p5.msh"));
    run.request.options.time_limit = limited ? 1000 : 0;
    run.request.options.max_iterations = limited ? 1'000'000 : 3;
    run.request.options.tolerance = 1e-15;
    run.request.options.method = Method::Sweeps;
    run.request.options.active_set = false;
    run.hooks.on_iteration = [&](const Iteration& iteration) {
      rlimit limits{};
      EXPECT_EQ(::prlimit(process, RLIMIT_CPU, nullptr, &limits), 0);
      EXPECT_EQ(limits.rlim_cur != RLIM_INFINITY, limited);
      if (limited && iteration.number == 1) {
        limits.rlim_cur = 1;
        EXPECT_EQ(::prlimit(process, RLIMIT_CPU, &limits, nullptr), 0);
      }
      return Control::Continue;
    };
    const auto outcome = run.run(in_processes([&](int id) { process = id; }));
    ASSERT_TRUE(outcome);
    EXPECT_EQ(outcome->lost, limited ? "used more processor time than its time limit allows" : "");
  }
}

}  // namespace
}  // namespace varimesh::server
