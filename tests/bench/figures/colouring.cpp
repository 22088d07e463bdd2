// Prints how the free nodes of a mesh are coloured, by node and by group, as one JSON document:
//   paper_colouring MESH
// tests/bench/paper uses it. A sweep goes through the colours one after another; the threads share the work of one
// colour.
#include "core/solvers/sweeps/colouring.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "core/formats/formats.h"
#include "core/problem/fixed_nodes.h"
#include "core/problem/problem.h"

namespace {

using namespace varimesh;

/// The largest number of free nodes in a cell. No two of them can have the same colour, so the colouring by node has at
/// least this many colours.
int most_free_nodes_of_a_cell(const Problem& problem) {
  std::vector<int> counts(problem.cells, 0);
  for (const Incidence& at : problem.incidences) ++counts[problem.sets[at.set].first + at.cell];
  return counts.empty() ? 0 : *std::max_element(counts.begin(), counts.end());
}

void print_counts(const char* name, const std::vector<int>& counts) {
  std::printf("\"%s\": [", name);
  for (std::size_t i = 0; i < counts.size(); ++i) std::printf("%s%d", i ? ", " : "", counts[i]);
  std::printf("]");
}

/// Prints for each colour how many groups can be worked on at the same time, and how many nodes they have.
void print_colouring(const char* name, const ColouredNodes& coloured) {
  std::vector<int> groups, nodes;
  for (std::size_t colour = 0; colour < coloured.colour_count(); ++colour) {
    const std::int32_t first = coloured.colours[colour], last = coloured.colours[colour + 1];
    groups.push_back(last - first);
    nodes.push_back(coloured.groups[last] - coloured.groups[first]);
  }
  std::printf("\"%s\": {\"colours\": %zu, ", name, coloured.colour_count());
  print_counts("groups", groups);
  std::printf(", ");
  print_counts("nodes", nodes);
  std::printf("}");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "paper_colouring MESH\n"), 2;
  const auto file = formats::read_file(argv[1]);
  if (!file) return std::fprintf(stderr, "paper_colouring: %s\n", file.error().sentence.c_str()), 3;
  const auto fixed = choose_fixed_nodes(file->mesh, {});
  if (!fixed) return std::fprintf(stderr, "paper_colouring: %s\n", fixed.error().sentence.c_str()), 3;
  const Problem problem = build_problem(file->mesh, *fixed, 0);
  std::printf("{\"free_nodes\": %zu, \"most_free_nodes_of_a_cell\": %d, ", problem.free.size(),
              most_free_nodes_of_a_cell(problem));
  print_colouring("node", colour_nodes(problem, Colouring::Node));
  std::printf(", ");
  print_colouring("group", colour_nodes(problem, Colouring::Group));
  std::printf("}\n");
  return 0;
}
