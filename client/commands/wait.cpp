// varimesh wait: waits until several jobs have ended.
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <iostream>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/job_table.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/jobs/selection.h"
#include "client/jobs/several.h"
#include "client/process/exit_status.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Selection selection;
};

/// Prints what happens while the jobs are waited for.
class Printer {
 public:
  explicit Printer(const CommonFlags& flags)
      : flags_(flags), draws_(!flags.quiet && !flags.json && isatty(STDERR_FILENO) == 1) {}

  void end(const v1::Job& job) {
    endings_.add(job);
    if (flags_.json)
      documents_.push_back(document(job));
    else if (!flags_.quiet)
      print(as_plain_text(job.name()) + "  " + spelled(job.state()) + "  " + words_about(job) + "  " + ending_of(job));
  }
  void deleted(const std::string& name) {
    endings_.add_deleted();
    clear();
    std::cerr << "varimesh: " << name << " was deleted by someone else" << std::endl;
  }
  void look(std::size_t ended, std::size_t all) {
    if (!draws_ || ended == all) return;
    std::cerr << "\r\x1b[K" << ended << " of " << all << " jobs have ended" << std::flush;
    drawn_ = true;
  }
  int finish() {
    clear();
    if (flags_.json)
      client::print({{"jobs", documents_}});
    else if (!flags_.quiet)
      std::cerr << endings_.sentence() << std::endl;
    return endings_.exit_status();
  }
  void clear() {
    if (drawn_) std::cerr << "\r\x1b[K" << std::flush;
    drawn_ = false;
  }

 private:
  void print(const std::string& line) {
    clear();
    std::cout << line << std::endl;
  }

  const CommonFlags& flags_;
  const bool draws_;
  bool drawn_ = false;
  Endings endings_;
  Json documents_ = Json::array();
};

/// The word as a shell reads it.
std::string quoted(const std::string& word) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || std::strchr("-_./:=,+@%", c) != nullptr; };
  if (std::ranges::all_of(word, is_plain)) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string way_back(const Arguments& arguments) {
  std::string line = "varimesh wait";
  for (const std::string& name : arguments.selection.names) line += " " + quoted(name);
  if (arguments.selection.all) line += " --all";
  for (const std::string& label : arguments.selection.labels) line += " --label " + quoted(label);
  return line + " --server " + quoted(arguments.common.server);
}

int wait_for_jobs(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const auto jobs = chosen(client, arguments.selection);
  if (!jobs) return print_error(jobs.error());
  Printer printer(arguments.common);
  Waiting waiting;
  waiting.on_end = [&](const v1::Job& job) { printer.end(job); };
  waiting.on_deleted = [&](const std::string& name) { printer.deleted(name); };
  waiting.on_look = [&](std::size_t ended, std::size_t all) { printer.look(ended, all); };
  const auto ended = wait_for_ends(client, *jobs, waiting);
  if (ended) return printer.finish();
  printer.clear();
  if (ended.error().kind != Failure::Kind::Interrupted) return print_error(ended.error());
  std::cerr << "varimesh: interrupted; the jobs go on. To come back to them:\n  " << as_plain_text(way_back(arguments))
            << std::endl;
  return kInterrupted;
}

}  // namespace

Action add_wait(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(program, "wait", "Wait until several jobs have ended, and print a line for each",
                                       &arguments->common);
  add_selection(command, &arguments->selection);
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return wait_for_jobs(*arguments); };
}

}  // namespace varimesh::client
