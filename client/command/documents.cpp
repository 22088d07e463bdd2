// Documents, summaries and the history.
#include "client/command/documents.h"

#include <fmt/format.h>

#include <iostream>

#include "client/command/names.h"
#include "core/formats/output_file.h"

namespace varimesh::client {
namespace {

Json mesh_document(const v1::MeshSummary& mesh) {
  return {{"dimension", mesh.dimension()},
          {"order", mesh.order()},
          {"elements", mesh.elements()},
          {"nodes", mesh.nodes()},
          {"free_nodes", mesh.free_nodes()}};
}

Json quality_document(const v1::QualityReport& quality) {
  const v1::Certified& certified = quality.certified();
  return {{"min_scaled_jacobian", quality.min_scaled_jacobian()},
          {"mean_scaled_jacobian", quality.mean_scaled_jacobian()},
          {"min_distortion_jacobian", quality.min_distortion_jacobian()},
          {"invalid_elements", quality.invalid_elements()},
          {"certified",
           {{"valid", certified.valid()},
            {"invalid", certified.invalid()},
            {"undecided", certified.undecided()},
            {"min_scaled_jacobian_lower_bound", certified.min_scaled_jacobian_lower_bound()}}}};
}

Json group_document(const v1::UnrepairableGroup& group) {
  Json elements = Json::array();
  for (const std::int64_t element : group.elements()) elements.push_back(element);
  Json document = {{"kind", spelled(group.kind())},
                   {"elements", std::move(elements)},
                   {"place", {group.x(), group.y(), group.z()}},
                   {"determinant", group.determinant()},
                   {"sentence", group.sentence()}};
  if (group.vertex() != 0) document["vertex"] = group.vertex();
  return document;
}

Json group_document(const UnrepairableGroup& group) {
  constexpr const char* kKinds[] = {"vertex", "vertex-group", "edge", "face", "folded-face", "fan"};
  Json document = {{"kind", kKinds[static_cast<int>(group.kind)]},
                   {"elements", group.elements},
                   {"place", group.place},
                   {"determinant", group.determinant},
                   {"sentence", group.sentence}};
  if (group.vertex != 0) document["vertex"] = group.vertex;
  return document;
}

template <class Groups>
Json groups_document(const Groups& groups) {
  Json all = Json::array();
  for (const auto& group : groups) all.push_back(group_document(group));
  return all;
}

Json repairs_document(const v1::Metrics& metrics) {
  Json all = Json::array();
  for (const v1::RepairStep& step : metrics.repairs()) {
    Json document = {{"kind", spelled(step.kind())}, {"sentence", step.sentence()}};
    for (const std::int64_t element : step.elements()) document["elements"].push_back(element);
    for (const std::int64_t element : step.new_elements()) document["new_elements"].push_back(element);
    for (const std::int64_t vertex : step.vertices()) document["vertices"].push_back(vertex);
    if (step.node() != 0) document["node"] = step.node();
    all.push_back(std::move(document));
  }
  return all;
}

const char* spelled(Certificate::Answer answer) {
  return answer == Certificate::Answer::Invalid ? "invalid" : "undecided";
}

std::string sizes(int dimension, int order, std::int64_t elements, std::int64_t nodes, std::int64_t free_nodes) {
  return fmt::format("{}-D mesh of order {}: {} elements, {} nodes, {} of them free\n", dimension, order, elements,
                     nodes, free_nodes);
}

/// The first few groups, in their own sentences.
std::string unrepairable(const v1::Metrics& metrics) {
  constexpr int kShown = 5;
  std::string text;
  for (int i = 0; i < std::min(kShown, metrics.unrepairable_size()); ++i)
    text += metrics.unrepairable(i).sentence() + "\n";
  if (metrics.unrepairable_size() > kShown)
    text += fmt::format("and {} more groups that no movement of nodes repairs; --json names them all\n",
                        metrics.unrepairable_size() - kShown);
  return text;
}

/// The first few steps, in their own sentences.
std::string repairs(const v1::Metrics& metrics) {
  constexpr int kShown = 5;
  std::string text;
  for (int i = 0; i < std::min(kShown, metrics.repairs_size()); ++i) text += metrics.repairs(i).sentence() + "\n";
  if (metrics.repairs_size() > kShown)
    text += fmt::format("and {} more steps of repair; --json says all\n", metrics.repairs_size() - kShown);
  return text;
}

/// The bins that hold something, a line each.
std::string histogram(const QualityReport& quality) {
  // Ten lines tell a person more than fifty.
  constexpr std::size_t kLines = 10;
  constexpr std::size_t kEach = QualityReport::kBins / kLines;
  std::string text;
  if (quality.invalid_elements > 0) text += fmt::format("  not above 0 {:>9}\n", quality.invalid_elements);
  for (std::size_t line = 0; line < kLines; ++line) {
    std::int64_t count = 0;
    for (std::size_t bin = 0; bin < kEach; ++bin) count += quality.histogram[line * kEach + bin];
    if (count > 0)
      text += fmt::format("  {:.1f} to {:.1f}  {:>10}\n", static_cast<double>(line) / 10.0,
                          static_cast<double>(line + 1) / 10.0, count);
  }
  return text;
}

}  // namespace

Json document(const v1::Metrics& metrics) {
  return {{"mesh", mesh_document(metrics.mesh())},
          {"energy", spelled(metrics.energy())},
          {"method", spelled(metrics.method())},
          {"iterations", metrics.iterations()},
          {"seconds", metrics.seconds()},
          {"residual", metrics.residual()},
          {"converged", metrics.converged()},
          {"stop_reason", spelled(metrics.stop_reason())},
          {"before", quality_document(metrics.before())},
          {"after", quality_document(metrics.after())},
          {"unrepairable", groups_document(metrics.unrepairable())},
          {"repairs", repairs_document(metrics)}};
}

Json document(const MeshSummary& mesh, const QualityReport& quality, const std::vector<UnrepairableGroup>& groups) {
  Json uncertified = Json::array();
  for (const UncertifiedElement& element : quality.uncertified)
    uncertified.push_back({{"number", element.number}, {"answer", spelled(element.answer)}, {"place", element.place}});
  Json invalid = Json::array();
  for (const InvalidElement& element : quality.invalid)
    invalid.push_back(
        {{"number", element.number}, {"scaled_jacobian", element.scaled_jacobian}, {"place", element.place}});
  return {{"mesh",
           {{"dimension", mesh.dimension},
            {"order", mesh.order},
            {"elements", mesh.elements},
            {"nodes", mesh.nodes},
            {"free_nodes", mesh.free_nodes}}},
          {"quality",
           {{"min_scaled_jacobian", quality.min_scaled_jacobian},
            {"mean_scaled_jacobian", quality.mean_scaled_jacobian},
            {"min_distortion_jacobian", quality.min_distortion_jacobian},
            {"invalid_elements", quality.invalid_elements},
            {"lattice_intervals", quality.lattice_intervals},
            {"histogram", quality.histogram},
            {"invalid", std::move(invalid)},
            {"certified",
             {{"valid", quality.certified.valid},
              {"invalid", quality.certified.invalid},
              {"undecided", quality.certified.undecided},
              {"min_scaled_jacobian_lower_bound", quality.certified.min_scaled_jacobian_lower_bound}}},
            {"uncertified", std::move(uncertified)}}},
          {"unrepairable", groups_document(groups)}};
}

Json document(const v1::Job& job) {
  Json result = {{"job", job.name()}, {"state", spelled(job.state())}};
  if (job.spec().priority() != 0) result["priority"] = job.spec().priority();
  if (!job.request_id().empty()) result["request_id"] = job.request_id();
  if (!job.spec().labels().empty()) {
    Json labels = Json::object();
    for (const auto& [key, value] : job.spec().labels()) labels[key] = value;
    result["labels"] = std::move(labels);
  }
  if (job.has_iteration()) result["iterations"] = job.iteration().number();
  if (job.has_error()) result["error"] = {{"reason", job.error().reason()}, {"message", job.error().message()}};
  if (job.has_metrics()) result["metrics"] = document(job.metrics());
  return result;
}

Json document(const v1::GetServerInfoResponse& info) {
  Json inputs = Json::array(), outputs = Json::array(), energies = Json::array();
  for (const int format : info.input_formats()) inputs.push_back(spelled(static_cast<v1::MeshFormat>(format)));
  for (const int format : info.output_formats()) outputs.push_back(spelled(static_cast<v1::MeshFormat>(format)));
  for (const int energy : info.energies()) energies.push_back(spelled(static_cast<v1::Energy>(energy)));
  return {{"version", info.version()},
          {"threads", info.limits().threads()},
          {"max_mesh_bytes", info.limits().max_mesh_bytes()},
          {"max_pending_jobs", info.limits().max_pending_jobs()},
          {"max_pending_jobs_per_peer", info.limits().max_pending_jobs_per_peer()},
          {"max_running_jobs_per_peer", info.limits().max_running_jobs_per_peer()},
          {"max_watches_per_peer", info.limits().max_watches_per_peer()},
          {"max_uploads_per_peer", info.limits().max_uploads_per_peer()},
          {"pending_jobs", info.pending_jobs()},
          {"running_jobs", info.running_jobs()},
          {"input_formats", inputs},
          {"output_formats", outputs},
          {"energies", energies}};
}

void print(const Json& document) { std::cout << document.dump(2) << '\n'; }

std::string summary(const v1::Metrics& metrics) {
  const v1::MeshSummary& mesh = metrics.mesh();
  const v1::QualityReport& before = metrics.before();
  const v1::QualityReport& after = metrics.after();
  return sizes(mesh.dimension(), mesh.order(), mesh.elements(), mesh.nodes(), mesh.free_nodes()) +
         fmt::format("{} iterations in {:.3g} s, residual {:.3g}, {}\n", metrics.iterations(), metrics.seconds(),
                     metrics.residual(), metrics.converged() ? "converged" : "not converged") +
         fmt::format("                          {:>10}  {:>10}\n", "before", "after") +
         fmt::format("smallest scaled Jacobian  {:>10.5f}  {:>10.5f}\n", before.min_scaled_jacobian(),
                     after.min_scaled_jacobian()) +
         fmt::format("mean scaled Jacobian      {:>10.5f}  {:>10.5f}\n", before.mean_scaled_jacobian(),
                     after.mean_scaled_jacobian()) +
         fmt::format("smallest distortion       {:>10.5f}  {:>10.5f}\n", before.min_distortion_jacobian(),
                     after.min_distortion_jacobian()) +
         fmt::format("invalid elements          {:>10}  {:>10}\n", before.invalid_elements(),
                     after.invalid_elements()) +
         fmt::format("certified valid           {:>10}  {:>10}\n", before.certified().valid(),
                     after.certified().valid()) +
         fmt::format("undecided                 {:>10}  {:>10}\n", before.certified().undecided(),
                     after.certified().undecided()) +
         fmt::format("proved scaled Jacobian    {:>10.5f}  {:>10.5f}\n",
                     before.certified().min_scaled_jacobian_lower_bound(),
                     after.certified().min_scaled_jacobian_lower_bound()) +
         repairs(metrics) + unrepairable(metrics);
}

std::string summary(const MeshSummary& mesh, const QualityReport& quality) {
  std::string text = sizes(mesh.dimension, mesh.order, mesh.elements, mesh.nodes, mesh.free_nodes) +
                     fmt::format(
                         "smallest scaled Jacobian  {:>10.5f}\nmean scaled Jacobian      {:>10.5f}\n"
                         "smallest distortion       {:>10.5f}\ninvalid elements          {:>10}\n"
                         "certified valid           {:>10}\nundecided                 {:>10}\n"
                         "proved scaled Jacobian    {:>10.5f}\n"
                         "elements by scaled Jacobian, on a lattice of {} intervals an edge\n",
                         quality.min_scaled_jacobian, quality.mean_scaled_jacobian, quality.min_distortion_jacobian,
                         quality.invalid_elements, quality.certified.valid, quality.certified.undecided,
                         quality.certified.min_scaled_jacobian_lower_bound, quality.lattice_intervals) +
                     histogram(quality);
  constexpr std::size_t kShown = 10;
  for (std::size_t i = 0; i < std::min(kShown, quality.invalid.size()); ++i) {
    const InvalidElement& element = quality.invalid[i];
    text += fmt::format("  element {} is invalid: {:.4f} at ({:.6g}, {:.6g}, {:.6g})\n", element.number,
                        element.scaled_jacobian, element.place[0], element.place[1], element.place[2]);
  }
  if (quality.invalid.size() > kShown)
    text += fmt::format("  and {} more; --json names them all\n", quality.invalid.size() - kShown);
  return text;
}

Expected<void> write_history(const std::string& path, const std::vector<v1::Iteration>& history) {
  auto file = formats::OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  std::string lines =
      "iteration,phase,energy,residual,relative_gradient,min_scaled_jacobian,invalid_elements,repairable_elements,"
      "active_nodes,products,seconds\n";
  for (const v1::Iteration& one : history)
    lines += fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{},{},{},{},{:.6f}\n", one.number(),
                         spelled(one.phase()), one.energy(), one.residual(), one.relative_gradient(),
                         one.min_scaled_jacobian(), one.invalid_elements(), one.repairable_elements(),
                         one.active_nodes(), one.products(), one.seconds());
  file->write(lines);
  return file->commit();
}

}  // namespace varimesh::client
