// Runs the cases by which the project measures its speed, and prints each figure beside its goal and beside the figures
// of other programs. tests/bench/cases starts this program and explains its flags.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/base/machine_memory.h"
#include "tests/bench/table/table.h"

namespace {

using namespace varimesh::bench;

constexpr const char* kUsage =
    "cases_bench --cases FOLDER --cache FOLDER [--command VARIMESH] [--short | --long] [--strict] [--list]\n"
    "            [--row NAME]... [--most-elements NUMBER]\n"
    "--row takes the name of a row, or the beginning of names\n";

bool begins_with(const char* name, const std::string& beginning) {
  return std::strncmp(name, beginning.c_str(), beginning.size()) == 0;
}

}  // namespace

int main(int argc, char** argv) {
  varimesh::return_large_blocks();
  std::string cases, cache, command, most_elements;
  std::vector<std::string> wanted;
  bool small = false, all = false, strict = false, list = false;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    std::string* const value = argument == "--cases"           ? &cases
                               : argument == "--cache"         ? &cache
                               : argument == "--command"       ? &command
                               : argument == "--most-elements" ? &most_elements
                               : argument == "--row"           ? &wanted.emplace_back()
                                                               : nullptr;
    if (value && i + 1 < argc) {
      *value = argv[++i];
    } else if (argument == "--short") {
      small = true;
    } else if (argument == "--long") {
      all = true;
    } else if (argument == "--strict") {
      strict = true;
    } else if (argument == "--list") {
      list = true;
    } else {
      std::fprintf(stderr, "cases_bench: the argument %s is unknown, or its value is missing\n%s", argument.c_str(),
                   kUsage);
      return 2;
    }
  }
  std::vector<Row> rows;
  for (const std::vector<Row>* some :
       {&kCaseRows, &kMachineRows, &kMemoryRows, &kLinearRows, &kSizeRows, &kScalingRows, &kCommandRows})
    rows.insert(rows.end(), some->begin(), some->end());
  for (const std::string& name : wanted)
    if (std::none_of(rows.begin(), rows.end(), [&](const Row& row) { return begins_with(row.name, name); })) {
      std::fprintf(stderr, "cases_bench: there is no row %s; --list prints the names\n", name.c_str());
      return 2;
    }
  if (list) {
    for (const Row& row : rows)
      std::printf("%-28s%s\n", row.name,
                  row.when == When::Short   ? "short"
                  : row.when == When::Asked ? "long: only with --long or --row"
                                            : "");
    return 0;
  }
  Bench bench{Runner(Meshes(cases, cache)), Table(), small};
  bench.command = command;
  if (!most_elements.empty()) bench.most_elements = std::atoll(most_elements.c_str());
  bench.table.head();
  for (const Row& row : rows) {
    const bool asked =
        std::any_of(wanted.begin(), wanted.end(), [&](const std::string& name) { return begins_with(row.name, name); });
    const bool usual = small ? row.when == When::Short : all || row.when != When::Asked;
    if (wanted.empty() ? usual : asked) row.measure(bench);
  }
  bench.table.foot();
  if (bench.table.failed() > 0) return 1;
  return strict && bench.table.missed() > 0 ? 3 : 0;
}
