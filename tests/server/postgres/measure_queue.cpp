// Fills the queue in a PostgreSQL database and measures how long it takes to submit, claim and finish jobs, by several
// stores at the same time. It prints figures and does not judge them.
//
//   FSYNC=on tests/server/postgres/database_server start FILE
//   varimeshd migrate --store "$(cat FILE)"
//   measure_queue --store "$(cat FILE)" --jobs 100000
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <mutex>
#include <set>
#include <thread>

#include "core/base/sha256.h"
#include "server/postgres/connection.h"
#include "server/postgres/postgres_jobs.h"

namespace varimesh::server::testing {
namespace {

struct Arguments {
  std::string store;
  int jobs = 100'000;
  int workers = 4;
  int peers = 1;          ///< Who take turns.
  int repetitions = 500;  ///< Of each worker.
};

/// The times of many calls.
class Times {
 public:
  template <class Call>
  auto measure(const Call& call) {
    const auto begun = std::chrono::steady_clock::now();
    auto answer = call();
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
    std::lock_guard lock(mutex_);
    all_.push_back(took.count());
    return answer;
  }
  void print(const char* what) {
    std::sort(all_.begin(), all_.end());
    const auto at = [&](double part) {
      return all_[static_cast<std::size_t>(part * static_cast<double>(all_.size() - 1))];
    };
    std::printf("%-10s %6zu times   p50 %7.2f ms   p99 %7.2f ms   most %7.2f ms\n", what, all_.size(), at(0.5),
                at(0.99), at(1));
  }

 private:
  std::mutex mutex_;
  std::vector<double> all_;
};

/// Copies the one job in the database until there are as many as asked for.
void fill(PostgresConnection& connection, int jobs, int peers) {
  connection.run("SET statement_timeout = 0");
  constexpr int kAtOnce = 5'000;  // a statement that takes longer than 15 s is taken for lost
  for (int from = 0; from < jobs; from += kAtOnce)
    // The name is also in the message of the job. One of the same length can take its place.
    connection.run(
        "WITH named AS (SELECT 'jobs/' || lpad(i::text, 5, '0') AS name FROM generate_series(" + std::to_string(from) +
        ", " + std::to_string(std::min(from + kAtOnce, jobs) - 1) +
        ") AS i), made AS (INSERT INTO jobs(name, owner, peer, state, turn, token, lost, furthest, worker, lease_end, "
        "history, checkpoint_iteration, job) SELECT named.name, owner, 'peer ' || right(named.name, 5)::integer % " +
        std::to_string(peers) +
        ", 1, turn, 0, 0, 0, '', 0, '', 0, "
        "decode(replace(encode(job, 'escape'), 'jobs/first', named.name), 'escape') "
        "FROM jobs, named WHERE jobs.name = 'jobs/first' RETURNING key) "
        "INSERT INTO specs SELECT made.key, spec FROM made, specs JOIN jobs USING(key) WHERE name = 'jobs/first'");
  connection.run("ANALYZE");
}

int run(const Arguments& arguments) {
  PostgresSettings where;
  where.url = arguments.store;
  JobStoreSettings settings;
  settings.clock = nullptr;
  const auto open = [&] { return open_postgres_jobs(where, settings); };
  const auto store = open();
  if (!store) return std::fprintf(stderr, "%s\n", store.error().sentence.c_str()), 1;
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(std::string(64, 'a'));
  if (!(*store)->submit({"", spec, "jobs/first", 1 << 30, {}, 0})) return 1;
  PostgresConnection connection(arguments.store);
  fill(connection, arguments.jobs, arguments.peers);

  Times submit, claim, progress, checkpoint, finish, counts, oldest, needed;
  std::vector<std::thread> workers;
  for (int worker = 0; worker < arguments.workers; ++worker)
    workers.emplace_back([&, worker] {
      const auto own = open();
      if (!own) return;
      Ending ending;
      ending.state = v1::JOB_STATE_SUCCEEDED;
      for (int i = 0; i < arguments.repetitions; ++i) {
        const std::string name = "jobs/" + std::to_string(worker) + "_" + std::to_string(i);
        submit.measure([&] { return (*own)->submit({"", spec, name, 1 << 30, "peer 0", 0}); });
        const auto claimed = claim.measure([&] { return (*own)->claim("worker " + std::to_string(worker)); });
        if (!claimed || !*claimed) continue;
        const Claim& mine = (*claimed)->claim;
        v1::Iteration iteration;
        iteration.set_number(1);
        progress.measure([&] { return (*own)->note_progress(mine, iteration, 2); });
        checkpoint.measure([&] { return (*own)->note_checkpoint(mine, {std::string(64, 'b'), 1}); });
        const auto ended = finish.measure([&] { return (*own)->finish(mine, ending, 2); });
        if (!ended) std::printf("a job cannot be finished: %s\n", ended.error().sentence.c_str());
      }
    });
  for (std::thread& worker : workers) worker.join();
  std::set<std::string> digests{std::string(64, 'a')};
  for (int i = 0; digests.size() < 1000; ++i) digests.insert(sha256(std::to_string(i)));
  for (int i = 0; i < 20; ++i) {
    counts.measure([&] { return (*store)->counts(); });
    oldest.measure([&] { return (*store)->oldest_pending(); });
    needed.measure([&] { return (*store)->referenced(digests); });
  }
  std::printf("%d jobs of %d peers wait, %d workers\n", (*store)->counts()->pending, arguments.peers,
              arguments.workers);
  submit.print("submit");
  claim.print("claim");
  progress.print("progress");
  checkpoint.print("checkpoint");
  finish.print("finish");
  counts.print("counts");
  oldest.print("oldest");
  needed.print("1000 digests, whether jobs need them");
  return 0;
}

}  // namespace
}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  varimesh::server::testing::Arguments arguments;
  CLI::App app{"Measures a long queue in PostgreSQL."};
  app.add_option("--store", arguments.store, "The address of the database, which must be empty")->required();
  app.add_option("--jobs", arguments.jobs, "Jobs that wait")->capture_default_str()->check(CLI::Range(1, 100'000));
  app.add_option("--workers", arguments.workers, "Stores that are used at the same time")->capture_default_str();
  app.add_option("--peers", arguments.peers, "Peers who take turns")
      ->capture_default_str()
      ->check(CLI::Range(1, 10'000));
  app.add_option("--repetitions", arguments.repetitions, "Jobs of each worker")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return varimesh::server::testing::run(arguments);
}
