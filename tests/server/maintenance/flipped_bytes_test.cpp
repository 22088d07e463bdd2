// One byte of a state directory changes while no server uses it. Whatever byte it is: the next server refuses what was
// damaged with a sentence, or runs the job again. It never gives a wrong mesh or a wrong record.
//
// VARIMESH_FLIPS=10000 build/release/tests/server/server_tests --gtest_filter='FlippedBytes.*' is the long form;
// VARIMESH_FLIPS_SEED=7 repeats its choices.
#include <cstdlib>
#include <random>

#include "tests/server/maintenance/state_folder.h"

namespace varimesh::server::testing {
namespace {

/// What a job was submitted with.
struct Submitted {
  std::string mesh, label;
};

class FlippedBytes : public StateFolder {
 protected:
  /// Leaves the directory as a server that was killed: some jobs have ended, one runs and has a checkpoint, and one
  /// waits. The newest changes are in the log of the database.
  void make_state() {
    std::atomic<bool> held = false;
    Engine engine = echo_engine(20);
    engine.run = [&, run = engine.run](RunRequest request, const RunHooks& hooks) {
      const bool slow = request.input->bytes().starts_with("slow");
      RunHooks holding = hooks;
      holding.on_iteration = [&, slow](const Iteration& iteration) {
        if (slow && iteration.number == 15) held = true;
        while (slow && iteration.number == 15 && !hooks.given_up()) std::this_thread::yield();
        return hooks.on_iteration(iteration);
      };
      return run(std::move(request), holding);
    };
    const std::filesystem::path running = folder_ / "running";
    ServerOptions options = StateFolder::options(engine, running);
    options.limits.threads = 1;
    options.limits.checkpoint_pause = std::chrono::milliseconds(0);
    const Service service(std::move(options));
    std::mt19937 random(3);
    for (int i = 0; i < 6; ++i) {
      std::string mesh = i < 4 ? "quick " : "slow ";
      for (int k = 0; k < 200 << i; ++k) mesh += static_cast<char>('a' + random() % 26);
      v1::JobSpec spec = service.spec_for(mesh);
      (*spec.mutable_labels())["number"] = std::to_string(i);
      const std::string name = service.submit(spec).name();
      jobs_[name] = {mesh, std::to_string(i)};
      if (i < 4) service.wait_for(name);
    }
    while (!held) std::this_thread::yield();
    std::filesystem::copy(running, state_, std::filesystem::copy_options::recursive);
  }

  /// Changes one byte of one file, the larger files more often. Returns what was changed.
  std::string flip(const std::filesystem::path& directory, std::mt19937_64& random) {
    std::vector<std::filesystem::path> files;
    std::vector<double> sizes;
    for (const auto& file : std::filesystem::recursive_directory_iterator(directory))
      if (file.is_regular_file() && file.file_size() > 0 && !file.path().string().ends_with("-shm")) {
        files.push_back(file.path());
        sizes.push_back(static_cast<double>(std::min<std::uintmax_t>(file.file_size(), 40'000)));
      }
    const auto& path = files[std::discrete_distribution<std::size_t>(sizes.begin(), sizes.end())(random)];
    std::string bytes = bytes_of(path);
    const std::size_t at = random() % bytes.size();
    bytes[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1 + random() % 255));
    write(path, bytes);
    return path.filename().string() + ", byte " + std::to_string(at);
  }

  /// What a server on the directory says about one job.
  enum class Kind { Right, Refused, Wrong };
  struct Outcome {
    Kind kind = Kind::Right;
    std::string why = {};
  };
  static Outcome refused(const grpc::Status& status) {
    if (status.error_message().empty()) return {Kind::Wrong, "refused without a sentence"};
    return {Kind::Refused, status.error_message()};
  }
  static Outcome ask(const Service& service, const std::string& name, const Submitted& submitted) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    v1::WatchJobRequest watch;
    watch.set_name(name);
    const auto events = service.jobs->WatchJob(&context, watch);
    v1::WatchJobResponse event;
    while (events->Read(&event)) {
    }
    const grpc::Status watched = events->Finish();
    if (watched.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED)
      return {Kind::Wrong, "did not end within 20 s; the last event: " + event.ShortDebugString()};
    grpc::ClientContext asking;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    if (const auto got = service.jobs->GetJob(&asking, request, &response); !got.ok()) return refused(got);
    const v1::Job& job = response.job();
    const auto label = job.spec().labels().find("number");
    if (job.name() != name || label == job.spec().labels().end() || label->second != submitted.label ||
        job.spec().mesh().digest() != sha256(submitted.mesh))
      return {Kind::Wrong, "another record: " + job.ShortDebugString()};
    if (job.state() == v1::JOB_STATE_FAILED && !job.error().message().empty())
      return {Kind::Refused, job.error().message()};
    if (job.state() != v1::JOB_STATE_SUCCEEDED || job.results_size() != 1)
      return {Kind::Wrong, "watched: " + watched.error_message() + "; then: " + job.ShortDebugString()};
    return download(service, job.results(0).digest(), submitted.mesh);
  }

  static Outcome download(const Service& service, const std::string& digest, const std::string& mesh) {
    grpc::ClientContext context;
    v1::DownloadMeshRequest request;
    request.set_digest(digest);
    const auto reader = service.meshes->DownloadMesh(&context, request);
    std::string bytes;
    v1::DownloadMeshResponse response;
    while (reader->Read(&response)) bytes += response.chunk().data();
    const grpc::Status status = reader->Finish();
    if (!status.ok()) return refused(status);
    return bytes == mesh ? Outcome() : Outcome{Kind::Wrong, "a result of other bytes"};
  }

  /// Asks a server on the directory about every job.
  void check(const std::filesystem::path& directory, const std::string& where) {
    auto started = Server::start(options(echo_engine(20), directory));
    if (!started) {
      EXPECT_FALSE(started.error().sentence.empty()) << where;
      ++not_started_;
      return;
    }
    Service service;
    service.use(std::move(*started));
    for (const auto& [name, submitted] : jobs_) {
      const Outcome outcome = ask(service, name, submitted);
      ++(outcome.kind == Kind::Right ? right_ : refused_);
      EXPECT_NE(outcome.kind, Kind::Wrong)
          << where << ", job " << submitted.label << " (" << name << "): " << outcome.why;
    }
  }

  std::map<std::string, Submitted> jobs_;
  int right_ = 0, refused_ = 0, not_started_ = 0;
};

TEST_F(FlippedBytes, AreRefusedOrTheJobIsRunAgain) {
  make_state();
  const char *asked = std::getenv("VARIMESH_FLIPS"), *given = std::getenv("VARIMESH_FLIPS_SEED");
  const int flips = asked == nullptr ? 60 : std::atoi(asked);
  const std::uint64_t seed = given != nullptr   ? std::strtoull(given, nullptr, 10)
                             : asked == nullptr ? 1
                                                : std::random_device()();
  std::mt19937_64 random(seed);
  const std::filesystem::path damaged = folder_ / "damaged";
  for (int i = 0; i < flips; ++i) {
    std::filesystem::copy(state_, damaged, std::filesystem::copy_options::recursive);
    const std::string where = flip(damaged, random);
    check(damaged, where + ", seed " + std::to_string(seed));
    std::filesystem::remove_all(damaged);
  }
  std::cout << flips << " flips: " << right_ << " jobs right, " << refused_ << " refused, " << not_started_
            << " servers refused to start\n";
}

}  // namespace
}  // namespace varimesh::server::testing
