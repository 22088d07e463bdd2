#include "client/io/summary.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/cli/names.h"
#include "core/diagnosis/elements_text.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

std::string sizes(int dimension, int order, std::int64_t elements, std::int64_t nodes, std::int64_t free_nodes) {
  return fmt::format("{}-D mesh of order {}: {} elements, {} nodes, {} of them free\n", dimension, order, elements,
                     nodes, free_nodes);
}

std::string sizes(const MeshSummary& mesh, bool is_surface) {
  if (!is_surface) return sizes(mesh.dimension, mesh.order, mesh.elements, mesh.nodes, mesh.free_nodes);
  return fmt::format("surface in space of order {}: {} elements, {} nodes; each element is judged along its normal\n",
                     mesh.order, mesh.elements, mesh.nodes);
}

/// The sentences of the first few groups of unrepairable elements, or steps of repair. `what` names them in the plural.
template <class Items>
std::string sentences(const Items& items, const char* what) {
  constexpr int kShown = 5;
  std::string text;
  for (int i = 0; i < std::min(kShown, items.size()); ++i) text += items[i].sentence() + "\n";
  if (items.size() > kShown) text += fmt::format("and {} more {}; --json lists all\n", items.size() - kShown, what);
  return text;
}

/// A proved bound; a dash if nothing is proved, which is the lowest double.
std::string bound_text(double bound) { return bound < -1e300 ? "–" : fmt::format("{:.5f}", bound); }

/// The histogram with one line per non-empty bin. The bins of the quality report are merged to ten, which are easier to
/// read.
std::string histogram(const QualityReport& quality) {
  constexpr std::size_t kLines = 10;
  constexpr std::size_t kEach = QualityReport::kBins / kLines;
  std::string text;
  if (quality.invalid_elements > 0) text += fmt::format("  0 or less   {:>10}\n", quality.invalid_elements);
  for (std::size_t line = 0; line < kLines; ++line) {
    std::int64_t count = 0;
    for (std::size_t bin = 0; bin < kEach; ++bin) count += quality.histogram[line * kEach + bin];
    if (count > 0)
      text += fmt::format("  {:.1f} to {:.1f}  {:>10}\n", static_cast<double>(line) / 10.0,
                          static_cast<double>(line + 1) / 10.0, count);
  }
  return text;
}

/// Why the run ended.
std::string ending(const v1::Metrics& metrics) {
  switch (metrics.stop_reason()) {
    case v1::STOP_REASON_CONVERGED:
      return "converged";
    case v1::STOP_REASON_VALID:
      return "ended because every element is certified valid";
    case v1::STOP_REASON_REPAIRED:
      return "ended because moving nodes can repair no more";
    case v1::STOP_REASON_NO_PROGRESS:
      return "not converged: ended because there was no progress";
    case v1::STOP_REASON_QUALITY:
      return "ended because the scaled Jacobian asked for is proved";
    case v1::STOP_REASON_TIME_LIMIT:
      return "not converged: ended by the time limit";
    case v1::STOP_REASON_ITERATIONS:
      return "not converged: ended by the largest number of iterations";
    case v1::STOP_REASON_STOPPED:
      return "not converged: stopped before its end";
    case v1::STOP_REASON_MOST_PRODUCTS:
      return "not converged: Newton steps reached the largest number of products";
    default:
      return "ended (" + spelled(metrics.stop_reason()) + ")";
  }
}

/// Why a run without --objective looked for the energy's optimum; empty if it was told to.
std::string why_energy(const v1::Metrics& metrics, const v1::Options& asked) {
  if (asked.objective() != v1::OBJECTIVE_UNSPECIFIED && asked.objective() != v1::OBJECTIVE_AUTO) return "";
  std::vector<std::string> flags;
  for (const OptionInfo& option : option_table())
    if (const auto* field = v1::Options::descriptor()->FindFieldByName(std::string(option.name));
        is_of_energy(option) && v1::Options::GetReflection()->HasField(asked, field))
      flags.push_back("--" + dashed(std::string(option.name)));
  if (!flags.empty())
    return fmt::format(", because {} {} given; --objective accuracy lowers the loss of accuracy", joined(flags, ", "),
                       flags.size() == 1 ? "is" : "are");
  return metrics.mesh().order() == 1 ? ", because no element of order 1 is curved" : "";
}

/// A loss of accuracy with three digits; "-" if there is none.
std::string loss_text(const v1::QualityReport& quality) {
  return quality.has_accuracy() ? fmt::format("{:.3g}", quality.accuracy().loss()) : "-";
}

/// What is left, and what to try next.
std::string way_out(const v1::WhatIsLeft& left) {
  if (left.uncertified() == 0) return "";
  std::string text = left.sentence() + "\n";
  for (const v1::Remedy& remedy : left.remedies()) text += remedy.sentence() + "\n";
  return text;
}

}  // namespace

std::string objective_text(const v1::Metrics& metrics, const v1::Options& asked) {
  const v1::QualityReport &before = metrics.before(), &after = metrics.after();
  switch (metrics.objective()) {
    case v1::OBJECTIVE_ACCURACY:
      return "objective: accuracy; loss of accuracy " + loss_text(before) + " -> " + loss_text(after);
    case v1::OBJECTIVE_ENERGY:
      return "objective: energy" + why_energy(metrics, asked);
    case v1::OBJECTIVE_WORST:
      return fmt::format("objective: worst; smallest scaled Jacobian {:.5f} -> {:.5f}", before.min_scaled_jacobian(),
                         after.min_scaled_jacobian());
    default:
      return "";
  }
}

std::string worse_text(const v1::Metrics& metrics) {
  constexpr double kSeen = 5e-5, kSeenOfLoss = 5e-3;  // a change that the figures show
  const v1::QualityReport &before = metrics.before(), &after = metrics.after();
  const bool loses = before.has_accuracy() && after.has_accuracy() &&
                     after.accuracy().loss() > (1 + kSeenOfLoss) * before.accuracy().loss();
  if (metrics.objective() != v1::OBJECTIVE_ACCURACY)
    return loses ? "The loss of accuracy rose because the objective " + spelled(metrics.objective()) +
                       " does not look at it; --objective accuracy lowers it."
                 : "";
  if (loses)
    return "The loss of accuracy rose because elements had to become valid, or reach the scaled Jacobian of --min-js, "
           "first.";
  if (after.mean_scaled_jacobian() < before.mean_scaled_jacobian() - kSeen)
    return "The mean scaled Jacobian fell because the objective accuracy looks at the error of a solver and not at "
           "shapes; --objective energy looks at shapes.";
  return "";
}

std::string way_out(const WhatIsLeft& left) {
  if (left.uncertified == 0) return "";
  std::string text = left.sentence + "\n";
  for (const Remedy& remedy : left.remedies) text += remedy.sentence + "\n";
  return text;
}

std::string summary(const v1::Metrics& metrics, const v1::Options& asked) {
  const v1::MeshSummary& mesh = metrics.mesh();
  const v1::QualityReport& before = metrics.before();
  const v1::QualityReport& after = metrics.after();
  const std::string objective = objective_text(metrics, asked), worse = worse_text(metrics);
  const std::string losses =
      fmt::format("loss of accuracy          {:>10}  {:>10}\n", loss_text(before), loss_text(after));
  const bool has_loss = after.has_accuracy();  // then it is the first figure
  return sizes(mesh.dimension(), mesh.order(), mesh.elements(), mesh.nodes(), mesh.free_nodes()) +
         fmt::format("{} iterations in {:.3g} s, residual {:.3g}, {}\n", metrics.iterations(), metrics.seconds(),
                     metrics.residual(), ending(metrics)) +
         objective + (objective.empty() ? "" : "\n") +
         fmt::format("                          {:>10}  {:>10}\n", "before", "after") + (has_loss ? losses : "") +
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
         fmt::format("certified invalid         {:>10}  {:>10}\n", before.certified().invalid(),
                     after.certified().invalid()) +
         fmt::format("undecided                 {:>10}  {:>10}\n", before.certified().undecided(),
                     after.certified().undecided()) +
         fmt::format("proved scaled Jacobian    {:>10}  {:>10}\n",
                     bound_text(before.certified().min_scaled_jacobian_lower_bound()),
                     bound_text(after.certified().min_scaled_jacobian_lower_bound())) +
         (has_loss ? "" : losses) + worse + (worse.empty() ? "" : "\n") +
         joined({metrics.notes().begin(), metrics.notes().end()}, "\n") + (metrics.notes().empty() ? "" : "\n") +
         (metrics.has_substitute_targets() ? metrics.substitute_targets().sentence() + "\n" : "") +
         sentences(metrics.repairs(), "steps of repair") +
         sentences(metrics.unrepairable(), "groups of elements that no movement of nodes can repair") +
         (metrics.kept_as_it_came().empty() ? "" : metrics.kept_as_it_came() + "\n") + way_out(metrics.left());
}

std::string summary(const MeshSummary& mesh, const QualityReport& quality) {
  std::string text =
      sizes(mesh, quality.is_surface) +
      fmt::format(
          "smallest scaled Jacobian  {:>10.5f}\nmean scaled Jacobian      {:>10.5f}\n"
          "smallest distortion       {:>10.5f}\ninvalid elements          {:>10}\n"
          "certified valid           {:>10}\ncertified invalid         {:>10}\n"
          "undecided                 {:>10}\nproved scaled Jacobian    {:>10}\n"
          "loss of accuracy          {:>10}\n"
          "elements by scaled Jacobian, sampled on a lattice of {} intervals per edge\n",
          quality.min_scaled_jacobian, quality.mean_scaled_jacobian, quality.min_distortion_jacobian,
          quality.invalid_elements, quality.certified.valid, quality.certified.invalid, quality.certified.undecided,
          bound_text(quality.certified.min_scaled_jacobian_lower_bound),
          quality.accuracy ? fmt::format("{:.3g}", quality.accuracy->loss) : "-", quality.lattice_intervals) +
      histogram(quality);
  if (!quality.clockwise.empty())
    text += clockwise_text(quality.clockwise, static_cast<std::size_t>(mesh.elements), mesh.dimension) +
            "; 'varimesh convert --orient' turns " + (quality.clockwise.size() == 1 ? "it\n" : "them\n");
  constexpr std::size_t kShown = 10;
  for (std::size_t i = 0; i < std::min(kShown, quality.invalid.size()); ++i) {
    const InvalidElement& element = quality.invalid[i];
    text += fmt::format("  element {} is invalid: {:.4f} at ({:.6g}, {:.6g}, {:.6g})\n", element.number,
                        element.scaled_jacobian, element.place[0], element.place[1], element.place[2]);
  }
  if (quality.invalid.size() > kShown)
    text += fmt::format("  and {} more; --json lists all\n", quality.invalid.size() - kShown);
  return text;
}

}  // namespace varimesh::client
