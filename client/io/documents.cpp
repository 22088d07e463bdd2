#include "client/io/documents.h"

#include <google/protobuf/util/time_util.h>

#include <iostream>

#include "client/cli/names.h"
#include "client/cli/remedies.h"

namespace varimesh::client {
namespace {

Json mesh_document(const v1::MeshSummary& mesh) {
  return {{"dimension", mesh.dimension()},
          {"order", mesh.order()},
          {"elements", mesh.elements()},
          {"nodes", mesh.nodes()},
          {"free_nodes", mesh.free_nodes()}};
}

Json accuracy_document(double loss, const std::vector<double>& modal_parts) {
  return {{"loss", loss}, {"modal_parts", modal_parts}};
}

Json in_layers_document(double error, std::int64_t cells) { return {{"error", error}, {"elements", cells}}; }

Json quality_document(const v1::QualityReport& quality) {
  const v1::Certified& certified = quality.certified();
  Json document = {{"min_scaled_jacobian", quality.min_scaled_jacobian()},
                   {"mean_scaled_jacobian", quality.mean_scaled_jacobian()},
                   {"min_distortion_jacobian", quality.min_distortion_jacobian()},
                   {"invalid_elements", quality.invalid_elements()},
                   {"clockwise_elements", quality.clockwise_elements()},
                   {"certified",
                    {{"valid", certified.valid()},
                     {"invalid", certified.invalid()},
                     {"undecided", certified.undecided()},
                     {"min_scaled_jacobian_lower_bound", certified.min_scaled_jacobian_lower_bound()}}}};
  if (quality.has_accuracy())
    document["accuracy"] = accuracy_document(
        quality.accuracy().loss(), {quality.accuracy().modal_parts().begin(), quality.accuracy().modal_parts().end()});
  if (quality.has_in_layers())
    document["in_layers"] = in_layers_document(quality.in_layers().error(), quality.in_layers().cells());
  return document;
}

Json group_document(const v1::UnrepairableGroup& group) {
  Json elements = Json::array();
  for (const std::int64_t element : group.elements()) elements.push_back(element);
  Json document = {{"kind", spelled(group.kind())},
                   {"elements", std::move(elements)},
                   {"place", {group.x(), group.y(), group.z()}},
                   {"determinant", group.determinant()},
                   {"proved", group.proved()},
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
                   {"proved", is_proved(group)},
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

Json substitutes_document(const v1::SubstituteTargets& targets) {
  Json elements = Json::array();
  for (const std::int64_t element : targets.elements()) elements.push_back(element);
  return {{"count", targets.count()}, {"elements", std::move(elements)}, {"sentence", targets.sentence()}};
}

Json remedy_document(const v1::Remedy& remedy) {
  return {{"kind", spelled(remedy.kind())},
          {"flags", flags_of(remedy)},
          {"elements", remedy.elements()},
          {"sentence", sentence_of(remedy)}};
}

Json left_document(const v1::WhatIsLeft& left) {
  Json remedies = Json::array();
  for (const v1::Remedy& remedy : left.remedies()) remedies.push_back(remedy_document(remedy));
  return {{"uncertified", left.uncertified()},
          {"proved", left.proved()},
          {"unproved", left.unproved()},
          {"sentence", left.sentence()},
          {"remedies", std::move(remedies)}};
}

Json left_document(const WhatIsLeft& left) {
  Json remedies = Json::array();
  for (const Remedy& remedy : left.remedies) remedies.push_back(remedy_document(to_proto(remedy)));
  return {{"uncertified", left.uncertified},
          {"proved", left.proved},
          {"unproved", left.unproved},
          {"sentence", left.sentence},
          {"remedies", std::move(remedies)}};
}

Json geometry_document(const v1::GeometryReport& geometry) {
  const auto distance = [](const v1::BoundaryDistance& one) {
    return Json{{"rms", one.rms()}, {"largest", one.largest()}};
  };
  Json surfaces = Json::array();
  for (const v1::SurfaceDistance& one : geometry.surfaces()) {
    surfaces.push_back({{"surface", one.surface()},
                        {"name", one.name()},
                        {"tags", std::vector<int>(one.tags().begin(), one.tags().end())},
                        {"elements", one.elements()},
                        {"folded", Json::object()},
                        {"distance", Json::object()}});
    Json& last = surfaces.back();
    if (one.has_before()) last["folded"]["before"] = one.folded_before();
    last["folded"]["after"] = one.folded_after();
    if (one.has_before()) last["distance"]["before"] = distance(one.before());
    last["distance"]["after"] = distance(one.after());
  }
  return {{"nodes", geometry.nodes()},
          {"farthest", geometry.farthest()},
          {"folded", {{"before", geometry.folded_before()}, {"after", geometry.folded_after()}}},
          {"distance",
           {{"before", geometry.has_before() ? distance(geometry.before()) : Json()},
            {"after", geometry.has_after() ? distance(geometry.after()) : Json()}}},
          {"straight_elements", geometry.straight_elements()},
          {"surfaces", std::move(surfaces)},
          {"sentences", std::vector<std::string>(geometry.sentences().begin(), geometry.sentences().end())}};
}

Json trials_document(const v1::Metrics& metrics) {
  Json trials = Json::array();
  for (const v1::SlideTrial& trial : metrics.slide_trials()) {
    Json one = {{"slide", spelled(trial.slide())}, {"outcome", spelled(trial.outcome())}};
    if (!trial.error().empty())
      one["error"] = trial.error();
    else
      one.update({{"uncertified", trial.left()}, {"min_scaled_jacobian", trial.min_scaled_jacobian()}});
    trials.push_back(std::move(one));
  }
  return trials;
}

const char* spelled(Certificate::Answer answer) {
  return answer == Certificate::Answer::Invalid ? "invalid" : "undecided";
}

}  // namespace

Json document(const v1::Metrics& metrics) {
  Json result = {{"mesh", mesh_document(metrics.mesh())},
                 {"energy", spelled(metrics.energy())},
                 {"method", spelled(metrics.method())},
                 {"objective", spelled(metrics.objective())},
                 {"iterations", metrics.iterations()},
                 {"seconds", metrics.seconds()},
                 {"residual", metrics.residual()},
                 {"converged", metrics.converged()},
                 {"stop_reason", spelled(metrics.stop_reason())},
                 {"before", quality_document(metrics.before())},
                 {"after", quality_document(metrics.after())},
                 {"unrepairable", groups_document(metrics.unrepairable())},
                 {"repairs", repairs_document(metrics)},
                 {"notes", metrics.notes()}};
  if (metrics.has_substitute_targets())
    result["substitute_targets"] = substitutes_document(metrics.substitute_targets());
  if (metrics.has_geometry()) result["geometry"] = geometry_document(metrics.geometry());
  if (metrics.slide_trials_size() > 0) result["slide_trials"] = trials_document(metrics);
  if (metrics.layers().has_thick()) {
    result["layers"] = document(metrics.layers());
    result["layers"]["thick"] = quality_document(metrics.layers().thick());
  }
  if (metrics.has_left()) result["left"] = left_document(metrics.left());
  if (!metrics.kept_as_it_came().empty()) result["kept_as_it_came"] = metrics.kept_as_it_came();
  if (!metrics.device().empty()) result["device"] = metrics.device();
  return result;
}

Json document(const v1::LayersReport& layers) {
  const auto range = [](const v1::LayersReport::Range& of) { return Json::array({of.least(), of.most()}); };
  Json result = {{"wall_elements", layers.wall_elements()},
                 {"columns", layers.columns()},
                 {"layers", layers.layers()},
                 {"leaves_cells", layers.leaves_cells()},
                 {"split", layers.split()},
                 {"split_beside", layers.split_beside()},
                 {"elements_before", layers.elements_before()},
                 {"elements_after", layers.elements_after()},
                 {"first_height", range(layers.first_height())},
                 {"last_height", range(layers.last_height())},
                 {"growth", range(layers.growth())},
                 {"same_shares", layers.same_shares()},
                 {"stretched", layers.stretched()}};
  if (layers.has_grown())
    result.update({{"grown_thickness", range(layers.grown())}, {"full_share", layers.full_share()}});
  return result;
}

Json document(const MeshSummary& mesh, const QualityReport& quality, const std::vector<UnrepairableGroup>& groups,
              const WhatIsLeft& left) {
  Json uncertified = Json::array();
  for (const UncertifiedElement& element : quality.uncertified)
    uncertified.push_back({{"number", element.number}, {"answer", spelled(element.answer)}, {"place", element.place}});
  Json invalid = Json::array();
  for (const InvalidElement& element : quality.invalid)
    invalid.push_back(
        {{"number", element.number}, {"scaled_jacobian", element.scaled_jacobian}, {"place", element.place}});
  Json result = {{"mesh",
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
                   {"clockwise_elements", quality.clockwise.size()},
                   {"clockwise", quality.clockwise},
                   {"is_surface", quality.is_surface},
                   {"certified",
                    {{"valid", quality.certified.valid},
                     {"invalid", quality.certified.invalid},
                     {"undecided", quality.certified.undecided},
                     {"min_scaled_jacobian_lower_bound", quality.certified.min_scaled_jacobian_lower_bound}}},
                   {"uncertified", std::move(uncertified)}}},
                 {"unrepairable", groups_document(groups)},
                 {"left", left_document(left)}};
  if (quality.accuracy)
    result["quality"]["accuracy"] = accuracy_document(quality.accuracy->loss, quality.accuracy->modal_parts);
  if (quality.in_layers)
    result["quality"]["in_layers"] = in_layers_document(quality.in_layers->error, quality.in_layers->cells);
  return result;
}

Json document(const v1::Job& job) {
  Json result = {{"job", job.name()}, {"state", spelled(job.state())}};
  if (!job.owner().empty()) result["owner"] = job.owner();
  if (job.spec().priority() != 0) result["priority"] = job.spec().priority();
  if (!job.request_id().empty()) result["request_id"] = job.request_id();
  if (!job.spec().labels().empty()) {
    Json labels = Json::object();
    for (const auto& [key, value] : job.spec().labels()) labels[key] = value;
    result["labels"] = std::move(labels);
  }
  if (const auto file = job.spec().labels().find("file"); file != job.spec().labels().end())
    result["file"] = file->second;
  using google::protobuf::util::TimeUtil;
  if (job.has_create_time()) result["submitted"] = TimeUtil::ToString(job.create_time());
  if (job.has_start_time()) result["began"] = TimeUtil::ToString(job.start_time());
  if (job.has_end_time()) result["ended"] = TimeUtil::ToString(job.end_time());
  if (job.has_metrics() || job.has_iteration())
    result["iterations"] = job.has_metrics() ? job.metrics().iterations() : job.iteration().number();
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
          {"takes_geometries", info.takes_geometries()},
          {"device", info.device()},
          {"devices", info.devices()},
          {"busy_devices", info.busy_devices()},
          {"jobs_on_devices", info.jobs_on_devices()},
          {"energies", energies}};
}

void print(const Json& document) { std::cout << document.dump(2) << '\n'; }

}  // namespace varimesh::client
