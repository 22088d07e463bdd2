// varimeshd backup: the copy of a running server's directory is a directory that a server can go on with.
#include "server/maintenance/backup.h"

#include <map>

#include "server/jobs/sqlite.h"
#include "server/maintenance/check.h"
#include "tests/server/maintenance/state_folder.h"

namespace varimesh::server::testing {
namespace {

class Backup : public StateFolder {
 protected:
  Backup() : copy_(folder_ / "copy") {}

  BackupReport back_up() {
    auto report = server::back_up(state_.string(), copy_.string());
    if (!report) ADD_FAILURE() << report.error().sentence;
    return report ? std::move(*report) : BackupReport();
  }

  const std::filesystem::path copy_;
};

TEST_F(Backup, OfARunningServerHasEveryAcceptedJobAndEveryResult) {
  std::map<std::string, std::string> meshes;  // by job
  std::atomic<bool> hold = true;
  {
    // Jobs whose mesh begins with "slow" run until the end of the first server.
    Engine engine = echo_engine(40);
    engine.run = [&, run = engine.run](RunRequest request, const RunHooks& hooks) {
      const bool slow = request.input->bytes().starts_with("slow");
      RunHooks held = hooks;
      held.on_iteration = [&, slow](const Iteration& iteration) {
        while (slow && hold && iteration.number == 20 && !hooks.given_up()) std::this_thread::yield();
        return hooks.on_iteration(iteration);
      };
      return run(std::move(request), held);
    };
    const Service service(options(engine, state_));
    const auto submit = [&](const std::string& mesh) {
      const v1::Job job = service.submit(service.spec_for(mesh));
      meshes[job.name()] = mesh;
      return job.name();
    };
    for (int i = 0; i < 5; ++i) service.wait_for(submit("quick " + std::to_string(i)));
    for (int i = 0; i < 4; ++i) submit("slow " + std::to_string(i));  // two run, two wait
    const BackupReport report = back_up();
    EXPECT_EQ(report.jobs, 9);
    EXPECT_TRUE(report.damage.empty()) << report.damage.front();
    hold = false;
  }
  const auto checked = check_state(copy_.string(), false);
  ASSERT_TRUE(checked) << checked.error().sentence;
  EXPECT_TRUE(checked->damage.empty()) << checked->damage.front();
  EXPECT_EQ(checked->jobs, 9);

  EXPECT_TRUE(std::filesystem::exists(copy_ / "backup-of-varimesh"));
  const Service restored(options(echo_engine(40), copy_));
  // From now on the copy has jobs of its own, and is no place for a backup.
  EXPECT_FALSE(std::filesystem::exists(copy_ / "backup-of-varimesh"));
  for (const auto& [name, mesh] : meshes) {
    const v1::Job job = restored.wait_for(name);
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
    ASSERT_EQ(job.results_size(), 1);
    EXPECT_EQ(restored.download(job.results(0).digest()), mesh);
  }
}

TEST_F(Backup, IsWholeWhateverTheServerDoesMeanwhile) {
  const Service service(options(echo_engine(30), state_));
  std::atomic<bool> done = false;
  std::thread load([&] {
    for (int i = 0; !done && i < 5000; ++i) {
      const v1::Job job = service.submit(service.spec_for("mesh " + std::to_string(i)));
      if (i % 2 == 0) continue;
      service.wait_for(job.name());
      grpc::ClientContext context;
      v1::DeleteJobRequest request;
      request.set_name(job.name());
      v1::DeleteJobResponse response;
      service.jobs->DeleteJob(&context, request, &response);
    }
  });
  for (int round = 0; round < 5; ++round) {
    EXPECT_TRUE(back_up().damage.empty());
    const auto checked = check_state(copy_.string(), false);
    ASSERT_TRUE(checked) << checked.error().sentence;
    for (const std::string& damage : checked->damage) ADD_FAILURE() << damage;
    EXPECT_EQ(checked->unreferenced, 0);
  }
  done = true;
  load.join();
}

TEST_F(Backup, CopiesOnlyWhatAnEarlierOneDoesNotHave) {
  std::string first;
  {
    const Service service(options(echo_engine(), state_));
    first = service.wait_for(service.submit(service.spec_for("first")).name()).name();
    EXPECT_EQ(back_up().copied, 2) << "the mesh and the history";
    service.wait_for(service.submit(service.spec_for("second")).name());
    const BackupReport second = back_up();
    EXPECT_EQ(second.copied, 1) << "the histories are the same";
    EXPECT_EQ(second.files, 3);
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(first);
    v1::DeleteJobResponse response;
    ASSERT_TRUE(service.jobs->DeleteJob(&context, request, &response).ok());
  }
  const BackupReport third = back_up();
  EXPECT_EQ(third.jobs, 1);
  EXPECT_EQ(third.files, 2);
  EXPECT_FALSE(std::filesystem::exists(copy_ / "meshes" / sha256("first"))) << "no job needs it any more";
}

TEST_F(Backup, SaysWhatTheDirectoryItselfHasLost) {
  {
    const Service service(options(echo_engine(), state_));
    service.wait_for(service.submit(service.spec_for("a mesh")).name());
  }
  write(file_of(sha256("a mesh")), "a mash");
  const BackupReport report = back_up();
  ASSERT_EQ(report.damage.size(), 1u);
  EXPECT_NE(report.damage[0].find(sha256("a mesh")), std::string::npos);
  EXPECT_EQ(report.files, 1) << "the history";
  EXPECT_FALSE(std::filesystem::exists(copy_ / "meshes" / sha256("a mesh"))) << "damage is not copied";
}

TEST_F(Backup, KeepsTheEarlierOneIfARowIsDamaged) {
  {
    const Service service(options(echo_engine(), state_));
    service.wait_for(service.submit(service.spec_for("a mesh")).name());
  }
  EXPECT_TRUE(back_up().damage.empty());
  SqliteDatabase((state_ / "jobs.sqlite").string()).run("UPDATE jobs SET sum = 7");
  const BackupReport report = back_up();
  EXPECT_EQ(report.damage.size(), 1u);
  EXPECT_TRUE(report.kept_earlier);
  const auto checked = check_state(copy_.string(), false);
  ASSERT_TRUE(checked) << checked.error().sentence;
  EXPECT_TRUE(checked->damage.empty()) << checked->damage.front();
  EXPECT_EQ(checked->files, 2);
}

TEST_F(Backup, CopiesAgainWhatIsDamagedInTheEarlierOne) {
  {
    const Service service(options(echo_engine(), state_));
    service.wait_for(service.submit(service.spec_for("a mesh")).name());
  }
  back_up();
  write(copy_ / "meshes" / sha256("a mesh"), "a mash");
  EXPECT_EQ(back_up().copied, 1);
  EXPECT_EQ(bytes_of(copy_ / "meshes" / sha256("a mesh")), "a mesh");
}

TEST_F(Backup, HasTheOwnersOfTheMeshes) {
  {
    const Service service(options(echo_engine(), state_));
    service.wait_for(service.submit(service.spec_for("a mesh")).name());
  }
  const std::string name = sha256("a mesh") + ".owners";
  write(state_ / "meshes" / name, sha256("an owner") + "\n");
  for (int round = 0; round < 2; ++round) {
    EXPECT_TRUE(back_up().damage.empty());
    EXPECT_EQ(bytes_of(copy_ / "meshes" / name), sha256("an owner") + "\n");
  }
  std::filesystem::remove(state_ / "meshes" / name);
  back_up();
  EXPECT_FALSE(std::filesystem::exists(copy_ / "meshes" / name)) << "the owner has deleted the mesh";
}

TEST_F(Backup, RefusesADirectoryThatIsNoBackup) {
  { const Service service(options(echo_engine(), state_)), other(options(echo_engine(), copy_)); }
  const auto swapped = server::back_up(copy_.string(), state_.string());
  ASSERT_FALSE(swapped);
  EXPECT_NE(swapped.error().sentence.find("is no backup"), std::string::npos);
}

TEST_F(Backup, RefusesItsOwnDirectoryAndOneThatAServerUses) {
  const Service service(options(echo_engine(), state_));
  back_up();
  const Service other(options(echo_engine(), copy_));
  EXPECT_FALSE(server::back_up(state_.string(), state_.string()));
  const auto used = server::back_up(state_.string(), copy_.string());
  ASSERT_FALSE(used);
  EXPECT_NE(used.error().sentence.find("a server has used it"), std::string::npos) << used.error().sentence;
  EXPECT_FALSE(server::back_up((folder_ / "none").string(), (folder_ / "new").string()));
}

}  // namespace
}  // namespace varimesh::server::testing
