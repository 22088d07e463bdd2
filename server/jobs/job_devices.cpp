// The calls about devices, which the servers of a shared store lend to jobs.
#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "server/jobs/job_rows.h"
#include "server/jobs/job_store.h"
#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

/// How many jobs are told at once that no server lends devices.
constexpr std::int64_t kMostTold = 100;

/// Adds the cards of `names`, which have ", " between them.
void add_names(std::string_view names, std::set<std::string>* cards) {
  while (!names.empty()) {
    const std::size_t end = std::min(names.find(", "), names.size());
    cards->emplace(names.substr(0, end));
    names.remove_prefix(std::min(end + 2, names.size()));
  }
}

}  // namespace

Answer<void> JobStore::note_devices(const std::string& worker, const LentDevices& devices) {
  if (!shared() || database_->is_away()) return {};
  const auto note = [&](JobWork& work) {
    const JobStoreSettings& settings = work.transitions.settings();
    const TimePoint now = settings.clock();
    work.sql.ask("DELETE FROM lent_devices WHERE worker = $1 OR lease_end <= $2",
                 SqlValues().add(worker).add(nanoseconds(now)));
    if (devices.devices == 0) return true;
    SqlValues values;
    values.add(worker).add(nanoseconds(now + settings.lease)).add(devices.names);
    values.add(devices.devices).add(devices.busy).add(devices.jobs);
    work.sql.ask(
        "INSERT INTO lent_devices(worker, lease_end, names, devices, busy, jobs) VALUES($1, $2, $3, $4, $5, $6) "
        "ON CONFLICT DO NOTHING",
        values);
    return true;
  };
  if (const auto failed = database_->write(note, JobDatabase::Outcome::CanBeSkipped)) return tl::unexpected(*failed);
  return {};
}

Answer<LentDevices> JobStore::lent_devices() {
  if (!shared()) return LentDevices();
  return read_jobs(*database_, [&](Sql& sql) -> Answer<LentDevices> {
    SqlValues values;
    add_time(values);
    LentDevices all;
    std::set<std::string> cards;
    sql.ask(std::string("SELECT devices, busy, jobs, names FROM lent_devices WHERE lease_end > coalesce($1, ") +
                sql.dialect().now + ")",
            values, [&](const SqlRow& row) {
              all.devices += static_cast<int>(row.number(0));
              all.busy += static_cast<int>(row.number(1));
              all.jobs += static_cast<int>(row.number(2));
              add_names(row.view(3), &cards);
            });
    for (const std::string& card : cards) all.names += (all.names.empty() ? "" : ", ") + card;
    return all;
  });
}

Answer<std::vector<Changed>> JobStore::tell_of_missing_devices() {
  using Result = std::vector<Changed>;
  if (!shared()) return Result();
  // Usually no job waits for a device, and then no transaction is needed.
  const auto waits = read_jobs(*database_, [](Sql& sql) -> Answer<bool> {
    return sql.number(
               "SELECT count(*) FROM (SELECT 1 FROM jobs WHERE state = 1 AND needs_device = 1 LIMIT 1) AS first") > 0;
  });
  if (!waits) return tl::unexpected(waits.error());
  if (!*waits) return Result();
  const auto lent = lent_devices();
  if (!lent) return tl::unexpected(lent.error());
  if (lent->devices > 0) return Result();
  Result told;
  const auto tell = [&](JobWork& work) {
    told.clear();
    // While the database was away nobody could tell it what it lends (take_back() waits for the same reason).
    if (!settings_.clock) {
      const TimePoint now = work.transitions.settings().clock();
      if (nanoseconds(now) - work.sql.number(work.sql.dialect().started) <= nanoseconds(TimePoint(settings_.lease)))
        return true;
    }
    std::vector<JobRow> rows;
    work.sql.ask(select_jobs(work.sql, std::string("WHERE state = 1 AND needs_device = 1 ORDER BY jobs.key LIMIT $1") +
                                           work.sql.dialect().lock_or_skip),
                 SqlValues().add(kMostTold), [&](const SqlRow& from) {
                   if (auto row = read_job(work.sql, from)) rows.push_back(std::move(*row));
                 });
    for (JobRow& row : rows) {
      told.push_back(work.transitions.tell_of_missing_devices(row.record));
      save_job(work, row, told.back());
      work.sql.ask("UPDATE jobs SET needs_device = 2 WHERE key = $1", SqlValues().add(row.key));
    }
    return true;
  };
  if (const auto failed = database_->write(tell, JobDatabase::Outcome::CanBeAskedAgain)) return tl::unexpected(*failed);
  return told;
}

}  // namespace varimesh::server
