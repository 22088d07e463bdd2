// Tests what the real server promises under load and when clients fail, with one trial per promise. kill_server,
// full_disk and queue_load test the rest.
//
//   load                    all trials, some minutes, on an idle machine: a figure above its limit is a failure
//   load --short            smaller trials, in seconds; figures are not judged (one of the default tests)
//   load --trial cancel     only this trial; may be repeated; --list prints the names
//
// Exit status: 0: all promises held; 1: some did not, with a line for each.
#include "tests/faults/load.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

namespace varimesh::server::testing {

void Verdict::expect(bool held, const std::string& what) {
  std::printf("%s: %s\n", held ? "held" : "VIOLATION", what.c_str());
  violations_ += held ? 0 : 1;
}

void Verdict::expect_at_most(double figure, double limit, const std::string& unit, const std::string& what) {
  const bool held = figure <= limit;
  std::printf("%s: %s: %.4g %s, at most %.4g\n",
              held              ? "held"
              : judges_figures_ ? "VIOLATION"
                                : "BEYOND",
              what.c_str(), figure, unit.c_str(), limit);
  violations_ += held || !judges_figures_ ? 0 : 1;
}

}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  using namespace varimesh::server::testing;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Setting setting{false, VARIMESHD};
  std::vector<std::string> names;
  bool list = false;
  CLI::App app{"Tests what varimeshd promises under load."};
  app.add_flag("--short", setting.short_form, "Smaller trials; figures are not judged");
  app.add_option("--trial", names, "Run only this trial; may be repeated")->allow_extra_args(false);
  app.add_flag("--list", list, "Print the names of the trials");
  app.add_option("--server", setting.program, "The varimeshd to test")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::map<std::string, Trial> trials = watching_trials();
  trials.merge(job_trials());
  trials.merge(mesh_trials());
  Verdict verdict(!setting.short_form);
  for (const auto& [name, trial] : trials) {
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end()) continue;
    std::printf("%s%s\n", list ? "" : "\n", name.c_str());
    if (!list) trial(setting, verdict);
  }
  return verdict.all_held() ? 0 : 1;
}
