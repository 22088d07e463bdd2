#include "core/problem/target_field.h"

#include <Eigen/Dense>
#include <cmath>
#include <numeric>
#include <string>
#include <unordered_map>

#include "core/base/io/text_lines.h"
#include "core/mesh/connectivity.h"

namespace varimesh {
namespace {

// What a value belongs to, for messages.
const char* thing(Per per) { return per == Per::Cell ? "element " : "node "; }

// === Which cell or node ==================================================================================

// Cells by element number, or nodes by node number.
std::unordered_map<std::int64_t, std::size_t> number_things(const HighOrderMesh& mesh, const Cells& cells, Per per) {
  std::unordered_map<std::int64_t, std::size_t> index;
  const std::size_t count = per == Per::Cell ? cells.count() : mesh.node_count();
  index.reserve(count);
  for (std::size_t i = 0; i < count; ++i) index.emplace(per == Per::Cell ? cells.number(i) : mesh.node_numbers[i], i);
  return index;
}

// The index of the cell or node that each value belongs to.
Expected<std::vector<std::size_t>> match(const HighOrderMesh& mesh, const Cells& cells, const TargetField& field,
                                         std::size_t count) {
  std::vector<std::size_t> at(field.values.size() / std::size_t(field.components));
  if (field.numbers.empty()) {
    if (at.size() != count)
      return bad_option("target_field has " + std::to_string(at.size()) + " values, but the mesh has " +
                        std::to_string(count) + (field.per == Per::Cell ? " cells" : " nodes") +
                        ": give one value for each, or give the numbers too.");
    std::iota(at.begin(), at.end(), std::size_t(0));
    return at;
  }
  if (field.numbers.size() != at.size())
    return bad_option("target_field has " + std::to_string(field.numbers.size()) + " numbers and values for " +
                      std::to_string(at.size()) + ": give one number for each value.");
  const auto index = number_things(mesh, cells, field.per);
  std::vector<bool> seen(count, false);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const std::string name = thing(field.per) + std::to_string(field.numbers[i]);
    const auto found = index.find(field.numbers[i]);
    if (found == index.end())
      return bad_input("The target field has a value for " + name + ", which is no " +
                       (field.per == Per::Cell ? "cell" : "node") + " of the mesh: use the numbers of the mesh file.");
    if (seen[found->second]) return bad_input("The target field lists " + name + " twice: give one value.");
    seen[found->second] = true;
    at[i] = found->second;
  }
  return at;
}

// === The stretch =========================================================================================

Eigen::MatrixXd tensor(const double* entries, int d) {
  Eigen::MatrixXd matrix(d, d);
  for (int i = 0, entry = 0; i < d; ++i)
    for (int j = 0; j <= i; ++j, ++entry) matrix(i, j) = matrix(j, i) = entries[entry];
  return matrix;
}

// Turns a value into its stretch, in place. False if the stretch is not positive.
bool stretch_of(double* value, int components, Target target, int d) {
  for (int c = 0; c < components; ++c)
    if (!std::isfinite(value[c])) return false;
  if (components == 1) {
    if (target == Target::Strain) value[0] += 1;
    return value[0] > 0;
  }
  Eigen::MatrixXd matrix = tensor(value, d);
  if (target == Target::Strain) matrix += Eigen::MatrixXd::Identity(d, d);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
  if (!(eigen.eigenvalues().minCoeff() > 0)) return false;
  const Eigen::MatrixXd stretch = target == Target::Strain ? matrix : Eigen::MatrixXd(eigen.operatorInverseSqrt());
  for (int i = 0, entry = 0; i < d; ++i)
    for (int j = 0; j <= i; ++j, ++entry) value[entry] = stretch(i, j);
  return true;
}

tl::unexpected<Error> not_positive(Target target, const std::string& name) {
  if (target == Target::Strain)
    return bad_input("The strain of " + name +
                     " is not above -1: give a finite number above -1, or a tensor whose eigenvalues are above -1.");
  return bad_input("The size of " + name +
                   " is not positive: give a finite edge length above 0, or a metric whose eigenvalues are above 0.");
}

// For every node whether it is a vertex of a cell. Only vertices need a value.
std::vector<bool> vertices_of(const HighOrderMesh& mesh, const Cells& cells) {
  std::vector<bool> vertex(mesh.node_count(), false);
  for (const Cells::Range& range : cells.ranges())
    for (std::size_t e = 0; e < range.block->size(); ++e)
      for (int v = 0; v < reference::info(range.block->shape).vertices; ++v)
        vertex[std::size_t(range.block->nodes[e * range.stride + std::size_t(v)])] = true;
  return vertex;
}

}  // namespace

Expected<TargetField> read_target_field(std::string_view text) {
  TargetField field;
  field.components = 0;
  std::string_view line;
  std::size_t number = 0;
  const auto refuse = [&](const std::string& what) {
    return bad_input("Line " + std::to_string(number) + " of the target field " + what);
  };
  const std::string_view heading = next_line(text, line, number) ? next_word(line) : std::string_view{};
  if (heading != "elements" && heading != "nodes")
    return refuse("does not say what the values belong to: begin the file with a line 'elements' or 'nodes'.");
  field.per = heading == "elements" ? Per::Cell : Per::Vertex;
  while (next_line(text, line, number)) {
    std::int64_t thing_number = 0;
    if (!parse(next_word(line), thing_number)) return refuse("does not begin with the number of an element or node.");
    field.numbers.push_back(thing_number);
    int components = 0;
    for (std::string_view word = next_word(line); !word.empty(); word = next_word(line), ++components) {
      double value = 0;
      if (!parse(word, value)) return refuse("holds '" + std::string(word.substr(0, 40)) + "', which is no number.");
      field.values.push_back(value);
    }
    if (field.components == 0) field.components = components;
    if (components == 0 || components != field.components)
      return refuse("has " + std::to_string(components) +
                    " values: give one, or the 3 (2-D) or 6 (3-D) entries of a tensor, the same in each line.");
  }
  if (field.components == 0)
    return refuse("is the last, and there is no value in the file: give one line 'number value' per value.");
  return field;
}

Expected<StretchField> resolve_target_field(const HighOrderMesh& mesh, const Options& options) {
  StretchField stretch;
  stretch.target = options.target;
  if (options.target != Target::Size && options.target != Target::Strain) return stretch;
  const TargetField& field = options.target_field;
  const int d = mesh.dimension;
  if (field.components != 1 && field.components != d * (d + 1) / 2)
    return bad_option("target_field has " + std::to_string(field.components) + " components; a " + std::to_string(d) +
                      "-D mesh needs 1 or " + std::to_string(d * (d + 1) / 2) + ".");
  const auto components = std::size_t(field.components);
  if (field.values.size() % components != 0)
    return bad_option("target_field has " + std::to_string(field.values.size()) +
                      " values, which is not a multiple of its " + std::to_string(components) +
                      " components; give all components of each value.");
  const Cells cells(mesh, d);
  const std::size_t count = field.per == Per::Cell ? cells.count() : mesh.node_count();
  const auto at = match(mesh, cells, field, count);
  if (!at) return tl::unexpected(at.error());

  stretch.per = field.per;
  stretch.components = field.components;
  // Cells and nodes without a value have no strain: S = 1.
  stretch.values.resize(count * components);
  for (std::size_t i = 0; i < count; ++i)
    for (int k = 0, entry = 0; k < d && entry < field.components; entry += ++k + 1)
      stretch.values[i * components + std::size_t(entry)] = 1;
  std::vector<bool> needs(count, true);
  if (field.per == Per::Vertex) needs = vertices_of(mesh, cells);
  for (std::size_t i = 0; i < at->size(); ++i) {
    const std::size_t index = (*at)[i];
    if (!needs[index]) continue;
    double* value = stretch.values.data() + index * components;
    std::copy_n(field.values.data() + i * components, components, value);
    if (!stretch_of(value, field.components, options.target, d))
      return not_positive(
          options.target,
          thing(field.per) + std::to_string(field.per == Per::Cell ? cells.number(index) : mesh.node_numbers[index]));
    needs[index] = false;
  }
  if (options.target == Target::Strain) return stretch;
  for (std::size_t i = 0; i < count; ++i)
    if (needs[i])
      return bad_input(
          "The target field has no size for " + std::string(thing(field.per)) +
          std::to_string(field.per == Per::Cell ? cells.number(i) : mesh.node_numbers[i]) +
          (field.per == Per::Cell ? ": give one for every cell." : ", which is a vertex: give one for every vertex."));
  return stretch;
}

}  // namespace varimesh
