// A job store in a PostgreSQL database, which many servers can share.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/postgres/listener.h"
#include "server/postgres/transactions.h"

namespace varimesh::server {

/// A job store whose calls are transactions of the database. The leases are on the database's clock; a clock in the
/// settings replaces it, for tests. Several processes may use the store at the same time.
///
/// A call fails with UNAVAILABLE (STORE_UNAVAILABLE) if the database cannot be reached. A call with a claim then has no
/// effect. If the connection breaks while a transaction is committed, the store asks the database for the outcome; only
/// submit(), request_cancel() and remove(), which a client can repeat, give up before it is known.
///
/// The limit of waiting jobs may be exceeded by the jobs that several clients submit at the same moment.
class PostgresJobStore : public JobStore {
 public:
  /// Connects to the database. UNAVAILABLE if it cannot be reached; INTERNAL if `varimeshd migrate` has not made its
  /// tables, if a newer version has, or if its jobs have their meshes in another directory.
  static Answer<std::unique_ptr<PostgresJobStore>> open(const PostgresSettings& where,
                                                        const JobStoreSettings& settings = {});

  bool durable() const override { return true; }
  bool shared() const override { return true; }
  void stop_waiting() override { database_.stop_waiting(); }
  void listen(std::function<void(const News&)> listener) override;
  Answer<Changed> submit(const Submission& submission) override;
  Answer<v1::Job> get(const std::string& name) override;
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) override;
  Answer<JobCounts> counts() override;
  Answer<std::optional<TimePoint>> oldest_pending() override;
  Answer<std::vector<v1::JobEvent>> events(const std::string& name) override;
  Answer<std::optional<Claimed>> claim(const std::string& worker) override;
  Answer<bool> renew_lease(const Claim& claim) override;
  Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) override;
  Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) override;
  Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) override;
  Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) override;
  Answer<Changed> ask_to_cancel(const std::string& name) override;
  Answer<Changed> see_cancel(const Claim& claim, std::int64_t last_sequence) override;
  Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) override;
  Answer<std::string> history_digest(const std::string& name) override;
  Answer<Changed> remove(const std::string& name) override;
  Answer<std::vector<std::string>> ended_beyond(std::size_t keep, TimePoint before) override;
  Answer<std::vector<Reference>> references() override;
  Answer<std::set<std::string>> referenced(const std::set<std::string>& digests) override;
  Answer<std::set<std::string>> needed_digests() override;

 private:
  PostgresJobStore(const PostgresSettings& where, const JobStoreSettings& settings) : database_(where, settings) {}

  /// Notes the directory of the meshes if the database has none yet, and compares it otherwise. INTERNAL if they
  /// differ.
  Answer<void> check_meshes();
  /// Changes the job of a claim if the claim is still valid.
  template <class Result>
  Answer<Result> write(const Claim& claim, const std::function<Result(const JobTransitions&, JobRecord&)>& work,
                       PostgresTransactions::Outcome outcome = PostgresTransactions::Outcome::MustBeKnown);
  /// QUEUE_FULL or PEER_LIMIT if another job may not wait.
  Answer<void> check_room(PostgresConnection& connection, const Submission& submission);
  /// Whether a count of the waiting jobs shows, without another one, that there is room for more.
  bool has_ample_room(int max_pending);

  PostgresTransactions database_;
  std::unique_ptr<PostgresListener> listener_;
  std::mutex waiting_mutex_;
  std::int64_t waiting_ = 0;  ///< Jobs that waited when they were counted, and those that this process added since.
  std::optional<SteadyTime> counted_;
};

}  // namespace varimesh::server
