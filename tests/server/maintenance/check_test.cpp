// varimeshd check: what is damaged is found, and with --repair set aside.
#include "server/maintenance/check.h"

#include <sqlite3.h>

#include "tests/server/maintenance/state_folder.h"

namespace varimesh::server::testing {
namespace {

class Check : public StateFolder {
 protected:
  /// Runs one job and returns it.
  v1::Job run_a_job(const std::string& mesh) {
    const Service service(options(echo_engine(), state_));
    return service.wait_for(service.submit(service.spec_for(mesh)).name());
  }

  CheckReport check(bool repair = false) {
    auto report = check_state(state_.string(), repair);
    if (!report) ADD_FAILURE() << report.error().sentence;
    return report ? std::move(*report) : CheckReport();
  }
};

TEST_F(Check, FindsNothingInWhatAServerHasLeft) {
  run_a_job("a mesh");
  const CheckReport report = check();
  EXPECT_TRUE(report.damage.empty()) << report.damage.front();
  EXPECT_EQ(report.jobs, 1);
  EXPECT_EQ(report.files, 2) << "the mesh, which is the result as well, and the history";
  EXPECT_EQ(report.unreferenced, 0);
}

TEST_F(Check, SetsADamagedFileAsideSoThatItIsTakenAgain) {
  const std::string digest = run_a_job("a mesh").results(0).digest();
  write(file_of(digest), "a mash");
  CheckReport report = check();
  ASSERT_EQ(report.damage.size(), 2u) << "the file, and the job that refers to it";
  EXPECT_NE(report.damage[0].find(digest), std::string::npos);
  EXPECT_NE(report.damage[1].find("jobs/"), std::string::npos) << report.damage[1];
  EXPECT_EQ(bytes_of(file_of(digest)), "a mash") << "without --repair nothing changes";

  report = check(true);
  EXPECT_NE(report.damage[0].find("was moved to"), std::string::npos) << report.damage[0];
  EXPECT_EQ(bytes_of(state_ / "damaged" / digest), "a mash");
  EXPECT_FALSE(std::filesystem::exists(file_of(digest)));
  EXPECT_EQ(run_a_job("a mesh").state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(check().damage.empty()) << "the same bytes are there again";
}

TEST_F(Check, FindsWhatIsMissingAndWhatIsNotTheServers) {
  const v1::Job job = run_a_job("a mesh");
  std::filesystem::remove(file_of(job.results(0).digest()));
  write(state_ / "meshes" / "letter.txt", "hello");
  write(file_of(sha256("unused")), "unused");
  const CheckReport report = check();
  ASSERT_EQ(report.damage.size(), 2u);
  EXPECT_NE(report.damage[0].find("letter.txt"), std::string::npos);
  EXPECT_NE(report.damage[1].find(job.name()), std::string::npos);
  EXPECT_EQ(report.unreferenced, 1);
}

TEST_F(Check, FindsDamagedRows) {
  const v1::Job job = run_a_job("a mesh");
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((state_ / "jobs.sqlite").c_str(), &database), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(database, "UPDATE jobs SET token = token + 1; UPDATE events SET event = x'00' WHERE key = 1",
                         nullptr, nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  const CheckReport report = check(true);
  ASSERT_EQ(report.damage.size(), 1u);
  EXPECT_NE(report.damage[0].find("record of " + job.name()), std::string::npos) << report.damage[0];
  EXPECT_EQ(report.unreferenced, 2) << "what the job refers to is not known";
}

TEST_F(Check, FindsADatabaseThatCannotBeRead) {
  run_a_job("a mesh");
  write(state_ / "jobs.sqlite", std::string(8192, 'x'));
  const CheckReport report = check(true);
  ASSERT_EQ(report.damage.size(), 1u);
  EXPECT_NE(report.damage[0].find("restore a backup"), std::string::npos) << report.damage[0];
}

TEST_F(Check, RefusesADirectoryThatAServerUsesAndOneWithoutJobs) {
  const Service service(options(echo_engine(), state_));
  const auto used = check_state(state_.string(), false);
  ASSERT_FALSE(used);
  EXPECT_NE(used.error().sentence.find("another varimeshd uses it"), std::string::npos);
  const auto empty = check_state(folder_.string(), false);
  ASSERT_FALSE(empty);
  EXPECT_NE(empty.error().sentence.find("holds no jobs"), std::string::npos);
}

}  // namespace
}  // namespace varimesh::server::testing
