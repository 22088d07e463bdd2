#include "client/jobs/selection.h"

#include <set>

#include "client/jobs/remote_job.h"
#include "client/library/failures.h"

namespace varimesh::client {

void add_selection(Command command, Selection* selection) {
  command.add("job", &selection->names, "The names of jobs").value("JOB").utf8();
  command.add("--all", &selection->all, "All jobs of the server; with --label, all jobs with this label");
  add_label_flag(command, &selection->labels, "All jobs with this label; may be repeated");
}

Outcome<std::vector<v1::Job>> chosen(Client* client, const Selection& selection) {
  const bool by_label = selection.all || !selection.labels.empty();
  if (by_label == !selection.names.empty())
    return refusal("BAD_OPTION", by_label ? "Give either the names of jobs, or --all and --label."
                                          : "Name at least one job, or choose jobs by --all or --label.");
  std::vector<v1::Job> jobs;
  if (by_label) {
    v1::ListJobsRequest filter;
    if (const auto labels = parse_labels(selection.labels, filter.mutable_labels()); !labels)
      return refusal("BAD_OPTION", labels.error().sentence);
    auto listed = client->list(filter);
    if (listed && listed->empty()) return refusal("BAD_OPTION", "There are no such jobs on the server.");
    return listed;
  }
  std::set<std::string> seen;
  for (const std::string& name : selection.names) {
    const auto full = full_name(client, name);
    if (!full) return tl::unexpected(full.error());
    if (!seen.insert(*full).second) continue;
    auto job = client->get(*full);
    if (!job) return tl::unexpected(job.error());
    jobs.push_back(std::move(*job));
  }
  return jobs;
}

}  // namespace varimesh::client
