#include "client/io/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "client/cli/names.h"
#include "client/cli/remedies.h"
#include "core/base/counted.h"
#include "core/command_line/facts.h"
#include "core/diagnosis/elements_text.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

std::string sizes(int dimension, int order, std::int64_t elements, std::int64_t nodes, std::int64_t free_nodes) {
  return fmt::format("{}-D mesh of order {}: {}, {}, {} of them free to move\n", dimension, order,
                     counted(elements, "element"), counted(nodes, "node"), free_nodes);
}

std::string sizes(const MeshSummary& mesh, bool is_surface) {
  if (!is_surface) return sizes(mesh.dimension, mesh.order, mesh.elements, mesh.nodes, mesh.free_nodes);
  return fmt::format("surface in space of order {}: {}, {}; each element is judged along its normal\n", mesh.order,
                     counted(mesh.elements, "element"), counted(mesh.nodes, "node"));
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

std::string iterations_text(const v1::Metrics& metrics) { return counted(metrics.iterations(), "iteration"); }

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

/// The error in layers with three digits; "-" if there are none, or invalid ones.
std::string layer_error_text(const v1::QualityReport& quality) {
  return quality.has_in_layers() ? fmt::format("{:.3g}", quality.in_layers().error()) : "-";
}

/// The quality with which the run ended: that of the result, or before the result was split into layers.
const v1::QualityReport& at_end_of_run(const v1::Metrics& metrics) {
  return metrics.layers().has_thick() ? metrics.layers().thick() : metrics.after();
}

/// What the figures mean, for those who see them for the first time.
constexpr const char *kOfLoss = "  of a solver; 0 is best", *kOfJacobian = "  1 is best; 0 or less: invalid",
                     *kOfProof = "  no element has less", *kInLayers = "  of what decays from the wall";

/// A table of the quality before and after, and with layers if there are some.
std::string figures(const v1::Metrics& metrics) {
  std::vector<std::pair<std::string, const v1::QualityReport*>> columns{{"before", &metrics.before()},
                                                                        {"after", &at_end_of_run(metrics)}};
  if (metrics.layers().has_thick()) columns.emplace_back("layers", &metrics.after());
  const auto row = [&](const char* name, const auto& text_of, const char* meaning = "") {
    std::string line = fmt::format("{:<24}", name);
    for (const auto& [heading, quality] : columns) line += fmt::format("  {:>10}", text_of(*quality));
    return line + (columns.size() == 2 ? meaning : "") + "\n";  // with layers, a terminal has no room for it
  };
  const auto number = [](double value) { return fmt::format("{:.5f}", value); };
  std::string losses = row("loss of accuracy", loss_text, kOfLoss);
  if (std::ranges::any_of(columns, [](const auto& column) { return column.second->has_in_layers(); }))
    losses += row("error in layers", layer_error_text, kInLayers);
  const bool has_loss = metrics.after().has_accuracy();  // then it is the first figure
  std::string heads = std::string(24, ' ');
  for (const auto& [heading, quality] : columns) heads += fmt::format("  {:>10}", heading);
  using Report = const v1::QualityReport&;
  return heads + "\n" + (has_loss ? losses : "") +
         row(
             "smallest scaled Jacobian", [&](Report of) { return number(of.min_scaled_jacobian()); }, kOfJacobian) +
         row("mean scaled Jacobian", [&](Report of) { return number(of.mean_scaled_jacobian()); }) +
         row("smallest distortion", [&](Report of) { return number(of.min_distortion_jacobian()); }) +
         row("invalid elements", [](Report of) { return of.invalid_elements(); }) +
         row("certified valid", [](Report of) { return of.certified().valid(); }) +
         row("certified invalid", [](Report of) { return of.certified().invalid(); }) +
         row("undecided", [](Report of) { return of.certified().undecided(); }) +
         row(
             "proved scaled Jacobian",
             [](Report of) { return bound_text(of.certified().min_scaled_jacobian_lower_bound()); }, kOfProof) +
         (has_loss ? "" : losses);
}

/// What is left, and what to try next.
std::string way_out(const v1::WhatIsLeft& left) {
  if (left.uncertified() == 0) return "";
  std::string text = left.sentence() + "\n";
  for (const v1::Remedy& remedy : left.remedies()) text += sentence_of(remedy) + "\n";
  return text;
}

std::string range_text(const v1::LayersReport::Range& range) {
  const bool is_one = range.most() <= range.least() * 1.0001;
  return is_one ? fmt::format("{:.4g}", range.least()) : fmt::format("{:.4g} to {:.4g}", range.least(), range.most());
}

/// Whether the mesh is good: how many of its elements are proved valid.
std::string verdict(const v1::Metrics& metrics) {
  const v1::Certified& certified = metrics.after().certified();
  const std::int64_t others = certified.invalid() + certified.undecided(), all = certified.valid() + others;
  if (all == 0) return "";
  if (all == 1 && others == 1) return "the element is not certified valid\n";
  return others == 0 ? "every element is certified valid\n"
                     : fmt::format("{} of {} elements are certified valid, {} {} not\n", certified.valid(), all, others,
                                   others == 1 ? "is" : "are");
}

}  // namespace

namespace {

constexpr double kSeenPercent = 0.5;

/// By how much a figure fell: ", 11 % lower"; empty if it did not fall by half a percent.
std::string lower_text(double before, double after) {
  const double percent = 100 * (1 - after / before);
  return percent >= kSeenPercent && std::isfinite(percent) ? fmt::format(", {:.0f} % lower", percent) : "";
}

/// The error in layers before and after, if it has changed: "; error in layers .02 -> .01, 50 % lower".
std::string layer_change_text(const v1::QualityReport& before, const v1::QualityReport& after) {
  if (!before.has_in_layers() || !after.has_in_layers()) return "";
  const double from = before.in_layers().error(), to = after.in_layers().error();
  if (std::abs(to - from) < kSeenPercent / 100 * from) return "";
  const std::string change = to < from ? lower_text(from, to) : fmt::format(", {:.0f} % higher", 100 * (to / from - 1));
  return "; error in layers " + layer_error_text(before) + " -> " + layer_error_text(after) + change;
}

}  // namespace

std::string done_text(const v1::Metrics& metrics) {
  const v1::MeshSummary& mesh = metrics.mesh();
  const bool has_slid = metrics.geometry().nodes() > 0;
  return fmt::format("{}{} of {} nodes were free to move{}; {}, {}.", has_slid ? "After boundary nodes slid, " : "",
                     mesh.free_nodes(), mesh.nodes(), has_slid ? "" : ", and the boundary stayed as it was",
                     iterations_text(metrics), ending(metrics));
}

std::string objective_text(const v1::Metrics& metrics, const v1::Options& asked) {
  const v1::QualityReport &before = metrics.before(), &after = at_end_of_run(metrics);
  switch (metrics.objective()) {
    case v1::OBJECTIVE_ACCURACY:
      return "objective: accuracy; loss of accuracy " + loss_text(before) + " -> " + loss_text(after) +
             (before.has_accuracy() && after.has_accuracy()
                  ? lower_text(before.accuracy().loss(), after.accuracy().loss())
                  : "") +
             layer_change_text(before, after);
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
  const v1::QualityReport &before = metrics.before(), &after = at_end_of_run(metrics);
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

std::string layers_text(const v1::LayersReport& report) {
  std::string text = fmt::format("layers     {} above {} wall elements, first height {}", report.layers(),
                                 report.wall_elements(), range_text(report.first_height()));
  if (report.layers() > 1)
    text += fmt::format(", growth {}, highest {}", range_text(report.growth()), range_text(report.last_height()));
  if (report.leaves_cells()) text += "; the rest of each thick cell is one more cell";
  text += report.has_grown()
              ? fmt::format("\nelements   {} before, {} with the row that was grown, {} with layers",
                            report.elements_before() - report.wall_elements(), report.elements_before(),
                            report.elements_after())
              : fmt::format("\nelements   {} before, {} after", report.elements_before(), report.elements_after());
  if (report.split_beside() > 0)
    text += fmt::format("; {} were split, and {} of these lie beside the wall and were split so that the mesh conforms",
                        report.split(), report.split_beside());
  if (report.has_grown())
    text += fmt::format("\ngrown      {} thick; {:.3g} % of the walls have the full thickness",
                        range_text(report.grown()), 100 * report.full_share());
  if (report.same_shares())
    text +=
        "\nheights    each layer takes the same share of every thick element, because equal heights would make "
        "elements invalid";
  if (report.stretched() > 0.01)
    text += fmt::format(
        "\nheights    differ by up to {:.2g} % from the heights asked for, so that no layer crosses from one row to "
        "the next",
        100 * report.stretched());
  return text + "\n";
}

std::string way_out(const WhatIsLeft& left) {
  if (left.uncertified == 0) return "";
  std::string text = left.sentence + "\n";
  for (const Remedy& remedy : left.remedies) text += sentence_of(to_proto(remedy)) + "\n";
  return text;
}

std::string summary(const v1::Metrics& metrics, const v1::Options& asked) {
  const v1::MeshSummary& mesh = metrics.mesh();
  const std::string objective = objective_text(metrics, asked), worse = worse_text(metrics);
  return sizes(mesh.dimension(), mesh.order(), mesh.elements(), mesh.nodes(), mesh.free_nodes()) +
         fmt::format("{} in {:.3g} s, residual {:.3g}, {}\n", iterations_text(metrics), metrics.seconds(),
                     metrics.residual(), ending(metrics)) +
         objective + (objective.empty() ? "" : "\n") + verdict(metrics) + figures(metrics) + worse +
         (worse.empty() ? "" : "\n") + (metrics.layers().has_thick() ? layers_text(metrics.layers()) : "") +
         (metrics.device().empty() ? ""
                                   : "Steps of Newton's method were made on the device " + metrics.device() + ".\n") +
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
          "smallest scaled Jacobian  {:>10.5f}{}\nmean scaled Jacobian      {:>10.5f}\n"
          "smallest distortion       {:>10.5f}\ninvalid elements          {:>10}\n"
          "certified valid           {:>10}\ncertified invalid         {:>10}\n"
          "undecided                 {:>10}\nproved scaled Jacobian    {:>10}{}\n"
          "loss of accuracy          {:>10}{}\n{}"
          "elements by scaled Jacobian, sampled on a lattice of {} intervals per edge\n",
          quality.min_scaled_jacobian, kOfJacobian, quality.mean_scaled_jacobian, quality.min_distortion_jacobian,
          quality.invalid_elements, quality.certified.valid, quality.certified.invalid, quality.certified.undecided,
          bound_text(quality.certified.min_scaled_jacobian_lower_bound), kOfProof,
          quality.accuracy ? fmt::format("{:.3g}", quality.accuracy->loss) : "-", kOfLoss,
          quality.in_layers
              ? fmt::format("error in layers           {:>10.3g}{}\n", quality.in_layers->error, kInLayers)
              : "",
          quality.lattice_intervals) +
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
