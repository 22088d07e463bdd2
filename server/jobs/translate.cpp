// Field by field; the enums of the contract are those of the library plus one, held by the assertions below.
#include "server/jobs/translate.h"

#include <algorithm>
#include <cassert>

#include "core/base/utf8.h"

namespace varimesh::server {
namespace {

template <class Message, class Value>
constexpr bool same(Message message, Value value) {
  return static_cast<int>(message) == static_cast<int>(value) + 1;
}
static_assert(same(v1::ENERGY_HYPERELASTIC, Energy::Hyperelastic) &&
              same(v1::ENERGY_LINEAR_ELASTIC, Energy::LinearElastic) && same(v1::ENERGY_WINSLOW, Energy::Winslow) &&
              same(v1::ENERGY_DISTORTION, Energy::Distortion));
static_assert(same(v1::STRAIN_GREEN_LAGRANGE, Strain::GreenLagrange) && same(v1::STRAIN_SMALL, Strain::Small));
static_assert(same(v1::VOLUMETRIC_LOG, Volumetric::Log) && same(v1::VOLUMETRIC_TRACE, Volumetric::Trace));
static_assert(same(v1::WINSLOW_TRUE, Winslow::True) && same(v1::WINSLOW_PAPER, Winslow::Paper));
static_assert(same(v1::CONSTANTS_REFERENCE, Constants::Reference) && same(v1::CONSTANTS_STANDARD, Constants::Standard));
static_assert(same(v1::OBJECTIVE_ENERGY, Objective::Energy) && same(v1::OBJECTIVE_WORST, Objective::Worst));
static_assert(same(v1::REGULARISATION_ELEMENT, Regularisation::Element) &&
              same(v1::REGULARISATION_PATCH, Regularisation::Patch));
static_assert(same(v1::METHOD_AUTO, Method::Auto) && same(v1::METHOD_SWEEPS, Method::Sweeps) &&
              same(v1::METHOD_NEWTON, Method::Newton));
static_assert(same(v1::COLOURING_GROUP, Colouring::Group) && same(v1::COLOURING_NODE, Colouring::Node));
static_assert(same(v1::TARGET_STRAIGHT_SIDED, Target::StraightSided) && same(v1::TARGET_IDEAL, Target::Ideal) &&
              same(v1::TARGET_SIZE, Target::Size) && same(v1::TARGET_STRAIN, Target::Strain));
static_assert(same(v1::UNTIL_TOLERANCE, Until::Tolerance) && same(v1::UNTIL_VALID, Until::Valid));
static_assert(same(v1::REPAIR_NONE, Repair::None) && same(v1::REPAIR_REPORT, Repair::Report) &&
              same(v1::REPAIR_SPLIT, Repair::Split) && same(v1::REPAIR_STRAIGHTEN, Repair::Straighten));
static_assert(same(v1::RepairStep::KIND_SPLIT_EDGE, RepairStep::Kind::SplitEdge) &&
              same(v1::RepairStep::KIND_SPLIT_FACE, RepairStep::Kind::SplitFace) &&
              same(v1::RepairStep::KIND_STRAIGHTENED, RepairStep::Kind::Straightened) &&
              same(v1::RepairStep::KIND_LEFT, RepairStep::Kind::Left));
static_assert(same(v1::STOP_REASON_CONVERGED, StopReason::Converged) &&
              same(v1::STOP_REASON_STOPPED, StopReason::Stopped));
static_assert(same(v1::UnrepairableGroup::KIND_VERTEX, UnrepairableGroup::Kind::Vertex) &&
              same(v1::UnrepairableGroup::KIND_FAN, UnrepairableGroup::Kind::Fan));
static_assert(same(v1::PER_CELL, Per::Cell) && same(v1::PER_VERTEX, Per::Vertex));
static_assert(same(v1::PHASE_SWEEPS, Phase::Sweeps) && same(v1::PHASE_NEWTON, Phase::Newton) &&
              same(v1::PHASE_UNTANGLE, Phase::Untangle));

/// Sets `value` from the message's enum; UNSPECIFIED leaves the default. False where the number is not known.
template <class Value, class Message>
bool take(Message message, bool known, Value* value) {
  if (message != 0 && known) *value = static_cast<Value>(static_cast<int>(message) - 1);
  return known;
}

template <class Message, class Value>
Message give(Value value) {
  return static_cast<Message>(static_cast<int>(value) + 1);
}

}  // namespace

Answer<Options> options_from(const v1::Options& message) {
  Options options;
  const char* unknown = nullptr;
  const auto check = [&](bool known, const char* name) {
    if (!known && unknown == nullptr) unknown = name;
  };
  check(take(message.energy(), v1::Energy_IsValid(message.energy()), &options.energy), "energy");
  check(take(message.strain(), v1::Strain_IsValid(message.strain()), &options.strain), "strain");
  check(take(message.volumetric(), v1::Volumetric_IsValid(message.volumetric()), &options.volumetric), "volumetric");
  check(take(message.winslow(), v1::Winslow_IsValid(message.winslow()), &options.winslow), "winslow");
  check(take(message.constants(), v1::Constants_IsValid(message.constants()), &options.constants), "constants");
  check(take(message.regularisation(), v1::Regularisation_IsValid(message.regularisation()), &options.regularisation),
        "regularisation");
  check(take(message.method(), v1::Method_IsValid(message.method()), &options.method), "method");
  check(take(message.colouring(), v1::Colouring_IsValid(message.colouring()), &options.colouring), "colouring");
  check(take(message.target(), v1::Target_IsValid(message.target()), &options.target), "target");
  check(take(message.until(), v1::Until_IsValid(message.until()), &options.until), "until");
  check(take(message.repair(), v1::Repair_IsValid(message.repair()), &options.repair), "repair");
  check(take(message.objective(), v1::Objective_IsValid(message.objective()), &options.objective), "objective");
  const v1::TargetField& field = message.target_field();
  check(take(field.per(), v1::Per_IsValid(field.per()), &options.target_field.per), "target_field.per");
  if (unknown != nullptr)
    return failure(Failure::Code::InvalidArgument, "BAD_OPTION",
                   std::string("The option '") + unknown +
                       "' has a value that this server does not know; GetServerInfo says its version.",
                   {{"option", unknown}});
  options.mu = message.mu();
  options.lambda = message.lambda();
  options.kappa = message.kappa();
  if (message.has_tolerance()) options.tolerance = message.tolerance();
  if (message.has_max_iterations()) options.max_iterations = message.max_iterations();
  options.threads = message.threads();
  options.quadrature_degree = message.quadrature_degree();
  if (message.has_target_field()) options.target_field.components = field.components();
  options.target_field.numbers.assign(field.numbers().begin(), field.numbers().end());
  options.target_field.values.assign(field.values().begin(), field.values().end());
  options.fix.assign(message.fix().begin(), message.fix().end());
  options.free.assign(message.free().begin(), message.free().end());
  options.fix_nodes.assign(message.fix_nodes().begin(), message.fix_nodes().end());
  options.free_nodes.assign(message.free_nodes().begin(), message.free_nodes().end());
  options.region_below = message.region_below();
  if (message.has_rings()) options.rings = message.rings();
  if (message.has_p_norm()) options.p_norm = message.p_norm();
  options.order = message.order();
  if (message.has_active_set()) options.active_set = message.active_set();
  options.until_js = message.until_js();
  options.time_limit = message.time_limit();
  return options;
}

v1::Options to_proto(const Options& options) {
  v1::Options message;
  message.set_energy(give<v1::Energy>(options.energy));
  message.set_strain(give<v1::Strain>(options.strain));
  message.set_volumetric(give<v1::Volumetric>(options.volumetric));
  message.set_winslow(give<v1::Winslow>(options.winslow));
  message.set_constants(give<v1::Constants>(options.constants));
  message.set_mu(options.mu);
  message.set_lambda(options.lambda);
  message.set_kappa(options.kappa);
  message.set_regularisation(give<v1::Regularisation>(options.regularisation));
  message.set_method(give<v1::Method>(options.method));
  message.set_colouring(give<v1::Colouring>(options.colouring));
  message.set_tolerance(options.tolerance);
  message.set_max_iterations(options.max_iterations);
  message.set_threads(options.threads);
  message.set_quadrature_degree(options.quadrature_degree);
  message.set_target(give<v1::Target>(options.target));
  if (!options.target_field.values.empty()) {
    v1::TargetField& field = *message.mutable_target_field();
    field.set_per(give<v1::Per>(options.target_field.per));
    field.set_components(options.target_field.components);
    field.mutable_numbers()->Assign(options.target_field.numbers.begin(), options.target_field.numbers.end());
    field.mutable_values()->Assign(options.target_field.values.begin(), options.target_field.values.end());
  }
  message.mutable_fix()->Assign(options.fix.begin(), options.fix.end());
  message.mutable_free()->Assign(options.free.begin(), options.free.end());
  message.mutable_fix_nodes()->Assign(options.fix_nodes.begin(), options.fix_nodes.end());
  message.mutable_free_nodes()->Assign(options.free_nodes.begin(), options.free_nodes.end());
  message.set_region_below(options.region_below);
  message.set_rings(options.rings);
  message.set_p_norm(options.p_norm);
  message.set_order(options.order);
  message.set_active_set(options.active_set);
  message.set_until(give<v1::Until>(options.until));
  message.set_until_js(options.until_js);
  message.set_time_limit(options.time_limit);
  message.set_repair(give<v1::Repair>(options.repair));
  message.set_objective(give<v1::Objective>(options.objective));
  return message;
}

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
  message.set_seconds(iteration.seconds);
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
  message.set_sentence(group.sentence);
  return message;
}

v1::RepairStep to_proto(const RepairStep& step) {
  v1::RepairStep message;
  message.set_kind(give<v1::RepairStep::Kind>(step.kind));
  message.mutable_vertices()->Assign(step.vertices.begin(), step.vertices.end());
  message.set_node(step.node);
  message.mutable_elements()->Assign(step.elements.begin(), step.elements.end());
  message.mutable_new_elements()->Assign(step.new_elements.begin(), step.new_elements.end());
  message.set_sentence(step.sentence);
  return message;
}

v1::Metrics metrics(const RunOutcome& outcome, const Options& options) {
  v1::Metrics message;
  *message.mutable_mesh() = to_proto(outcome.summary);
  message.set_energy(give<v1::Energy>(options.energy));
  message.set_method(give<v1::Method>(options.method));
  message.set_iterations(outcome.iterations);
  message.set_seconds(outcome.seconds);
  message.set_residual(outcome.residual);
  message.set_converged(outcome.converged);
  *message.mutable_before() = to_proto(outcome.before);
  *message.mutable_after() = to_proto(outcome.after);
  message.set_stop_reason(give<v1::StopReason>(outcome.stop_reason));
  for (std::size_t i = 0; i < std::min(outcome.unrepairable.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i)
    *message.add_unrepairable() = to_proto(outcome.unrepairable[i]);
  for (std::size_t i = 0; i < std::min(outcome.repairs.size(), static_cast<std::size_t>(kMaxInvalidNamed)); ++i)
    *message.add_repairs() = to_proto(outcome.repairs[i]);
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
  // A sentence may quote the mesh, which need not be UTF-8.
  message.set_message(formats::as_utf8(error.sentence));
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
    default:
      return formats::Format::Auto;
  }
}

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
  }
  return v1::MESH_FORMAT_UNSPECIFIED;
}

}  // namespace varimesh::server
