// Conversion field by field. The enums of the contract are those of the library plus one, which the assertions below
// check.
#include "server/engine/translate.h"

#include <algorithm>
#include <cassert>

#include "core/base/utf8.h"
#include "server/engine/engine.h"

namespace varimesh::server {
namespace {

template <class Message, class Value>
constexpr bool same(Message message, Value value) {
  return static_cast<int>(message) == static_cast<int>(value) + 1;
}
static_assert(same(v1::RepairStep::KIND_SPLIT_EDGE, RepairStep::Kind::SplitEdge) &&
              same(v1::RepairStep::KIND_SPLIT_FACE, RepairStep::Kind::SplitFace) &&
              same(v1::RepairStep::KIND_STRAIGHTENED, RepairStep::Kind::Straightened) &&
              same(v1::RepairStep::KIND_LEFT, RepairStep::Kind::Left) &&
              same(v1::RepairStep::KIND_COLLAPSED, RepairStep::Kind::Collapsed));
static_assert(same(v1::STOP_REASON_CONVERGED, StopReason::Converged) &&
              same(v1::STOP_REASON_STOPPED, StopReason::Stopped) &&
              same(v1::STOP_REASON_MOST_PRODUCTS, StopReason::MostProducts));
static_assert(same(v1::LINEAR_SOLVE_NONE, LinearSolve::None) && same(v1::LINEAR_SOLVE_SOLVED, LinearSolve::Solved) &&
              same(v1::LINEAR_SOLVE_MOST_PRODUCTS, LinearSolve::MostProducts));
static_assert(same(v1::UnrepairableGroup::KIND_VERTEX, UnrepairableGroup::Kind::Vertex) &&
              same(v1::UnrepairableGroup::KIND_FAN, UnrepairableGroup::Kind::Fan));
static_assert(same(v1::Remedy::KIND_OPTIMISE, Remedy::Kind::Optimise) &&
              same(v1::Remedy::KIND_MORE_TIME, Remedy::Kind::MoreTime) &&
              same(v1::Remedy::KIND_UNTIL_VALID, Remedy::Kind::UntilValid) &&
              same(v1::Remedy::KIND_RAISE_ORDER, Remedy::Kind::RaiseOrder) &&
              same(v1::Remedy::KIND_SPLIT, Remedy::Kind::Split) && same(v1::Remedy::KIND_SLIDE, Remedy::Kind::Slide) &&
              same(v1::Remedy::KIND_OTHER_BOUNDARY, Remedy::Kind::OtherBoundary));
static_assert(same(v1::PHASE_SWEEPS, Phase::Sweeps) && same(v1::PHASE_NEWTON, Phase::Newton) &&
              same(v1::PHASE_UNTANGLE, Phase::Untangle) && same(v1::PHASE_ACCURACY, Phase::Accuracy));
static_assert(same(v1::Work::ACTIVITY_ASSEMBLY, Activity::Assembly) &&
              same(v1::Work::ACTIVITY_PRODUCTS, Activity::Products) &&
              same(v1::Work::ACTIVITY_SWEEP, Activity::Sweep) && same(v1::Work::ACTIVITY_SPLITS, Activity::Splits));

template <class Message, class Value>
Message give(Value value) {
  return static_cast<Message>(static_cast<int>(value) + 1);
}

/// The other way round; an enum that is not said is the library's first.
template <class Value, class Message>
Value take(Message message) {
  return static_cast<Value>(std::max(0, static_cast<int>(message) - 1));
}

}  // namespace

v1::Iteration to_proto(const Iteration& iteration) {
  v1::Iteration message;
  message.set_phase(give<v1::Phase>(iteration.phase));
  message.set_number(iteration.number);
  message.set_energy(iteration.energy);
  message.set_residual(iteration.residual);
  message.set_relative_gradient(iteration.relative_gradient);
  message.set_min_scaled_jacobian(iteration.min_scaled_jacobian);
  message.set_invalid_elements(iteration.invalid_elements);
  message.set_repairable_elements(iteration.repairable_elements);
  message.set_active_nodes(iteration.active_nodes);
  message.set_products(iteration.products);
  message.set_linear_solve(give<v1::LinearSolve>(iteration.linear_solve));
  message.set_on_device(iteration.on_device);
  message.set_left_elements(iteration.left_elements);
  message.set_seconds(iteration.seconds);
  if (iteration.groups_left >= 0) message.set_groups_left(iteration.groups_left);
  if (iteration.seconds_left >= 0) message.set_seconds_left(iteration.seconds_left);
  return message;
}

Iteration iteration_from(const v1::Iteration& message) {
  Iteration iteration;
  iteration.phase = take<Phase>(message.phase());
  iteration.number = message.number();
  iteration.energy = message.energy();
  iteration.residual = message.residual();
  iteration.relative_gradient = message.relative_gradient();
  iteration.min_scaled_jacobian = message.min_scaled_jacobian();
  iteration.invalid_elements = message.invalid_elements();
  iteration.repairable_elements = message.repairable_elements();
  iteration.left_elements = message.left_elements();
  iteration.active_nodes = message.active_nodes();
  iteration.products = message.products();
  iteration.linear_solve = take<LinearSolve>(message.linear_solve());
  iteration.on_device = message.on_device();
  iteration.seconds = message.seconds();
  if (message.has_groups_left()) iteration.groups_left = message.groups_left();
  if (message.has_seconds_left()) iteration.seconds_left = message.seconds_left();
  return iteration;
}

v1::Work to_proto(const Work& work) {
  v1::Work message;
  message.set_activity(give<v1::Work::Activity>(work.activity));
  message.set_done(work.done);
  message.set_of(work.of);
  if (work.groups_left >= 0) message.set_groups_left(work.groups_left);
  if (work.seconds_left > 0) message.set_seconds_left(work.seconds_left);  // 0: the run lasts longer than it said
  return message;
}

v1::MeshSummary to_proto(const MeshSummary& summary) {
  v1::MeshSummary message;
  message.set_dimension(summary.dimension);
  message.set_order(summary.order);
  message.set_elements(summary.elements);
  message.set_nodes(summary.nodes);
  message.set_free_nodes(summary.free_nodes);
  return message;
}

v1::QualityReport to_proto(const QualityReport& report) {
  v1::QualityReport message;
  message.set_min_scaled_jacobian(report.min_scaled_jacobian);
  message.set_mean_scaled_jacobian(report.mean_scaled_jacobian);
  message.set_min_distortion_jacobian(report.min_distortion_jacobian);
  message.set_invalid_elements(report.invalid_elements);
  for (const std::int64_t count : report.histogram) message.add_histogram(count);
  const std::size_t named = std::min(report.invalid.size(), static_cast<std::size_t>(kMaxInvalidNamed));
  for (std::size_t i = 0; i < named; ++i) {
    v1::InvalidElement& element = *message.add_invalid();
    element.set_number(report.invalid[i].number);
    element.set_scaled_jacobian(report.invalid[i].scaled_jacobian);
    element.set_x(report.invalid[i].place[0]);
    element.set_y(report.invalid[i].place[1]);
    element.set_z(report.invalid[i].place[2]);
  }
  message.set_lattice_intervals(report.lattice_intervals);
  if (report.accuracy) {
    v1::Accuracy& accuracy = *message.mutable_accuracy();
    accuracy.set_loss(report.accuracy->loss);
    for (const double part : report.accuracy->modal_parts) accuracy.add_modal_parts(part);
  }
  if (report.in_layers) {
    message.mutable_in_layers()->set_error(report.in_layers->error);
    message.mutable_in_layers()->set_cells(report.in_layers->cells);
  }
  v1::Certified& certified = *message.mutable_certified();
  certified.set_valid(report.certified.valid);
  certified.set_invalid(report.certified.invalid);
  certified.set_undecided(report.certified.undecided);
  certified.set_min_scaled_jacobian_lower_bound(report.certified.min_scaled_jacobian_lower_bound);
  for (std::size_t i = 0; i < std::min(report.uncertified.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i) {
    const UncertifiedElement& found = report.uncertified[i];
    v1::UncertifiedElement& element = *certified.add_uncertified();
    element.set_number(found.number);
    element.set_answer(found.answer == Certificate::Answer::Invalid ? v1::UncertifiedElement::ANSWER_INVALID
                                                                    : v1::UncertifiedElement::ANSWER_UNDECIDED);
    element.set_x(found.place[0]);
    element.set_y(found.place[1]);
    element.set_z(found.place[2]);
  }
  message.set_clockwise_elements(static_cast<std::int64_t>(report.clockwise.size()));
  for (std::size_t i = 0; i < std::min(report.clockwise.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i)
    message.add_clockwise(report.clockwise[i]);
  return message;
}

v1::UnrepairableGroup to_proto(const UnrepairableGroup& group) {
  v1::UnrepairableGroup message;
  message.set_kind(give<v1::UnrepairableGroup::Kind>(group.kind));
  message.set_vertex(group.vertex);
  message.mutable_elements()->Assign(group.elements.begin(), group.elements.end());
  message.set_x(group.place[0]);
  message.set_y(group.place[1]);
  message.set_z(group.place[2]);
  message.set_determinant(group.determinant);
  message.set_sentence(as_plain_text(group.sentence));
  message.set_proved(is_proved(group));
  return message;
}

namespace {

/// What to do for a remedy, in the words of the contract.
std::string what_to_do(const Remedy& remedy) {
  switch (remedy.kind) {
    case Remedy::Kind::Optimise:
      return "Submit a job";
    case Remedy::Kind::MoreTime:
      return "Give the run more time";
    case Remedy::Kind::UntilValid:
      return "Set options.until to UNTIL_VALID";
    case Remedy::Kind::RaiseOrder:
      return "Set options.order to " + std::to_string(remedy.order);
    case Remedy::Kind::Split:
      return "Set options.repair to REPAIR_SPLIT";
    case Remedy::Kind::Slide:
      return "Let boundary nodes slide on a CAD model (geometry.digest) or on the boundary as it came "
             "(geometry.slide_on = SLIDE_ON_BOUNDARY)";
    case Remedy::Kind::OtherBoundary:
      return "Mesh the boundary anew or refine it";
  }
  assert(false);
  return "";
}

}  // namespace

v1::WhatIsLeft to_proto(const WhatIsLeft& left) {
  v1::WhatIsLeft message;
  message.set_uncertified(left.uncertified);
  message.set_proved(left.proved);
  message.set_unproved(left.unproved);
  for (const Remedy& remedy : left.remedies) {
    v1::Remedy& added = *message.add_remedies();
    added.set_kind(give<v1::Remedy::Kind>(remedy.kind));
    added.set_elements(remedy.elements);
    added.set_order(remedy.order);
    added.set_reason(as_plain_text(remedy.reason));
    added.set_sentence(as_plain_text(what_to_do(remedy) + ": " + remedy.reason));
  }
  message.set_sentence(as_plain_text(left.sentence));
  return message;
}

v1::RepairStep to_proto(const RepairStep& step) {
  v1::RepairStep message;
  message.set_kind(give<v1::RepairStep::Kind>(step.kind));
  message.mutable_vertices()->Assign(step.vertices.begin(), step.vertices.end());
  message.set_node(step.node);
  message.mutable_elements()->Assign(step.elements.begin(), step.elements.end());
  message.mutable_new_elements()->Assign(step.new_elements.begin(), step.new_elements.end());
  message.set_sentence(as_plain_text(step.sentence));
  return message;
}

RunOutcome::RunOutcome(const RunSummary& summary) : stopped(summary.stopped), metrics(to_proto(summary)) {
  for (const Iteration& iteration : summary.history) *history.add_iterations() = to_proto(iteration);
}

void add_options(const Options& options, v1::Metrics& metrics) {
  metrics.set_energy(give<v1::Energy>(options.energy));
  metrics.set_method(give<v1::Method>(options.method));
  metrics.set_objective(give<v1::Objective>(objective_of(options, metrics.mesh().order())));
}

v1::Metrics to_proto(const RunSummary& summary) {
  v1::Metrics message;
  *message.mutable_mesh() = to_proto(summary.sizes);
  message.set_iterations(summary.iterations);
  message.set_seconds(summary.seconds);
  message.set_residual(summary.residual);
  message.set_converged(summary.converged);
  *message.mutable_before() = to_proto(summary.before);
  *message.mutable_after() = to_proto(summary.after);
  message.set_stop_reason(give<v1::StopReason>(summary.stop_reason));
  for (std::size_t i = 0; i < std::min(summary.unrepairable.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i)
    *message.add_unrepairable() = to_proto(summary.unrepairable[i]);
  for (std::size_t i = 0; i < std::min(summary.repairs.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i)
    *message.add_repairs() = to_proto(summary.repairs[i]);
  if (const auto& elements = summary.substitute_targets.elements; !elements.empty()) {
    v1::SubstituteTargets& named = *message.mutable_substitute_targets();
    named.set_count(static_cast<std::int64_t>(elements.size()));
    const std::size_t listed = std::min(elements.size(), static_cast<std::size_t>(kMaxInvalidNamed));
    named.mutable_elements()->Assign(elements.begin(), elements.begin() + static_cast<std::ptrdiff_t>(listed));
    named.set_sentence(as_plain_text(summary.substitute_targets.sentence));
  }
  for (const std::string& note : summary.notes) message.add_notes(as_plain_text(note));
  if (summary.left.uncertified > 0) *message.mutable_left() = to_proto(summary.left);
  message.set_kept_as_it_came(summary.kept_as_it_came);
  message.set_device(as_plain_text(summary.device));
  return message;
}

v1::JobError to_proto(const Error& error) {
  v1::JobError message;
  switch (error.kind) {
    case Error::Kind::BadInput:
      message.set_reason("BAD_INPUT");
      break;
    case Error::Kind::BadOption:
      message.set_reason("BAD_OPTION");
      break;
    case Error::Kind::Output:
      message.set_reason("OUTPUT");
      break;
    case Error::Kind::Internal:
      message.set_reason("INTERNAL");
      break;
  }
  // A sentence may quote the mesh, whose text may be anything.
  message.set_message(as_plain_text(error.sentence));
  return message;
}

formats::Format format_from(v1::MeshFormat message) {
  switch (message) {
    case v1::MESH_FORMAT_MSH22:
      return formats::Format::Msh22;
    case v1::MESH_FORMAT_MSH22_BINARY:
      return formats::Format::Msh22Binary;
    case v1::MESH_FORMAT_MSH41:
      return formats::Format::Msh41;
    case v1::MESH_FORMAT_MSH41_BINARY:
      return formats::Format::Msh41Binary;
    case v1::MESH_FORMAT_VTU:
      return formats::Format::Vtu;
    case v1::MESH_FORMAT_MFEM:
      return formats::Format::Mfem;
    case v1::MESH_FORMAT_NEKTAR:
      return formats::Format::Nektar;
    case v1::MESH_FORMAT_ISM:
      return formats::Format::Ism;
    case v1::MESH_FORMAT_SU2:
      return formats::Format::Su2;
    case v1::MESH_FORMAT_HOPR:
      return formats::Format::Hopr;
    case v1::MESH_FORMAT_CGNS:
      return formats::Format::Cgns;
    case v1::MESH_FORMAT_PYFR:
      return formats::Format::Pyfr;
    default:
      return formats::Format::Auto;
  }
}

namespace {

bool is_installed(v1::MeshFormat format) {
  return v1::MeshFormat_IsValid(format) && (!formats::needs_hdf5(format_from(format)) || formats::has_hdf5());
}

}  // namespace

bool is_readable(v1::MeshFormat format) {
  return is_installed(format) && format != v1::MESH_FORMAT_SU2 && format != v1::MESH_FORMAT_PYFR &&
         format != v1::MESH_FORMAT_CELL_QUALITY;
}

bool is_writable(v1::MeshFormat format) { return is_installed(format) && format != v1::MESH_FORMAT_ISM; }

v1::MeshFormat to_proto(formats::Format format) {
  switch (format) {
    case formats::Format::Auto:
      return v1::MESH_FORMAT_UNSPECIFIED;
    case formats::Format::Msh22:
      return v1::MESH_FORMAT_MSH22;
    case formats::Format::Msh22Binary:
      return v1::MESH_FORMAT_MSH22_BINARY;
    case formats::Format::Msh41:
      return v1::MESH_FORMAT_MSH41;
    case formats::Format::Msh41Binary:
      return v1::MESH_FORMAT_MSH41_BINARY;
    case formats::Format::Vtu:
      return v1::MESH_FORMAT_VTU;
    case formats::Format::Mfem:
      return v1::MESH_FORMAT_MFEM;
    case formats::Format::Nektar:
      return v1::MESH_FORMAT_NEKTAR;
    case formats::Format::Ism:
      return v1::MESH_FORMAT_ISM;
    case formats::Format::Su2:
      return v1::MESH_FORMAT_SU2;
    case formats::Format::Hopr:
      return v1::MESH_FORMAT_HOPR;
    case formats::Format::Cgns:
      return v1::MESH_FORMAT_CGNS;
    case formats::Format::Pyfr:
      return v1::MESH_FORMAT_PYFR;
    // These are only read, by their content, and a result in the format of the input is this one.
    case formats::Format::Abaqus:
    case formats::Format::Gmf:
    case formats::Format::Exodus:
      return v1::MESH_FORMAT_MSH41_BINARY;
  }
  return v1::MESH_FORMAT_UNSPECIFIED;
}

}  // namespace varimesh::server
