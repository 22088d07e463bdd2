// Jobs in memory: they go with the process.
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <string>

#include "server/jobs/job_store.h"

namespace varimesh::server {

class MemoryJobStore : public JobStore {
 public:
  Answer<Submitted> submit(const std::string& request_id, const v1::JobSpec& spec, const std::string& name,
                           TimePoint now, int max_pending) override;
  Answer<v1::Job> get(const std::string& name) override;
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) override;
  JobCounts counts() override;
  std::optional<Claim> claim(TimePoint now) override;
  Answer<v1::Job> request_cancel(const std::string& name, TimePoint now) override;
  void note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) override;
  Answer<v1::Job> finish(const Claim& claim, const Ending& ending, TimePoint now) override;
  Answer<std::string> history_digest(const std::string& name) override;
  Answer<Removed> remove(const std::string& name) override;
  std::vector<std::string> ended_beyond(std::size_t keep) override;

 private:
  struct Record {
    v1::Job job;
    std::int64_t token = 0;
    std::string history_digest;
  };
  using Records = std::map<std::int64_t, Record>;  ///< By order of submission.

  Answer<Records::iterator> find(const std::string& name);
  void end(Records::iterator record, v1::JobState state, TimePoint now);

  std::mutex mutex_;
  std::int64_t counter_ = 0;
  Records records_;
  std::map<std::string, std::int64_t> by_name_;
  std::map<std::string, std::int64_t> by_request_;
  std::deque<std::int64_t> pending_;
  std::deque<std::int64_t> ended_;
  int running_ = 0;
};

}  // namespace varimesh::server
