// Rows for whole runs of the library on the meshes of the cases.
#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "tests/bench/core/optimise/loads.h"
#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

constexpr double kKiB = 1024;
constexpr int kPairs = 5;

/// Six sweeps over every free node.
Run six_sweeps(const std::string& mesh, Energy energy) {
  Run run{mesh};
  run.options.energy = energy;
  run.options.method = Method::Sweeps;
  run.options.active_set = false;
  run.options.max_iterations = 6;
  run.options.tolerance = 1e-14;
  run.options.threads = 1;
  run.repeats = 5;  // some take only 12 ms
  return run;
}

void check_seconds(double seconds, double most, Line& line) {
  line.normalised = text("%.3g s", seconds);
  if (!(seconds <= most)) line.missed.emplace_back("time");
}

// === A sweep ===

void sweep(Bench& bench, const std::string& mesh, Energy energy, double most, const char* peers) {
  Line line{mesh + ", a sweep, " + std::string(name(energy)), "", "", text("%g s", most), {}, "", peers};
  Measured m;
  if (!bench.measure(line.what, six_sweeps(mesh, energy), m)) return;
  line.measured = text("%.3g s", m.times().sweep);
  line.quality = quality_of(m);
  line.disturbed = m.conditions.disturbed();
  check_seconds(m.normalised().sweep, most, line);
  bench.table.add(line);
}

constexpr const char* kSpherePeers = "NekMesh 10.1, its later design 2.9, prototype 0.38";

// === Convergence ===

struct Goal {
  double tolerance;
  double lambda;  ///< 0: the reference constant.
  double most;    ///< Seconds.
  double min_js;  ///< The smallest Js that the result must have; 0: no goal.
  double within;  ///< How far min_js may be missed.
};

Line convergence(Bench& bench, const std::string& mesh, const Goal& goal, const char* peers, Measured& m) {
  Line line{mesh + text(" to %g", goal.tolerance), "", "", text("%g s", goal.most), {}, "", peers};
  if (goal.lambda > 0) line.what += text(", lambda %g", goal.lambda);
  if (goal.min_js > 0) line.target += text(", min Js %g +- %g", goal.min_js, goal.within);
  if (!bench.measure(line.what, until_tolerance(mesh, goal.tolerance, goal.lambda), m)) return {};
  line.measured = text("%.3g s", m.times().whole);
  line.quality = quality_of(m);
  line.disturbed = m.conditions.disturbed();
  check_seconds(m.normalised().whole, goal.most, line);
  if (!m.converged) line.missed.emplace_back("not converged");
  if (goal.min_js > 0 && !(std::abs(m.min_scaled_jacobian - goal.min_js) <= goal.within))
    line.missed.emplace_back("min Js");
  if (m.uncertified > 0) line.missed.emplace_back("validity");
  return line;
}

void converge(Bench& bench, const std::string& mesh, const Goal& goal, const char* peers) {
  Measured m;
  const Line line = convergence(bench, mesh, goal, peers, m);
  if (!line.what.empty()) bench.table.add(line);
}

void converge_large(Bench& bench) {
  Measured m;
  const Line line = convergence(bench, "sph120k_p4", {1e-3, 0, 30, 0, 0}, "prototype 33.5", m);
  if (line.what.empty()) return;
  bench.table.add(line);
  Line memory{"sph120k_p4, memory at the peak", text("%.3g GB", m.peak_bytes * 1e-9), "", "1.05 GB", {}, "",
              "NekMesh 390 KiB per element"};
  if (m.peak_bytes > 1.05e9) memory.missed.emplace_back("memory");
  memory.quality = text("%.2f KiB per element", m.peak_bytes / kKiB / static_cast<double>(m.elements));
  bench.table.add(memory);
}

void untangle_wing(Bench& bench) {
  Line line{"dlrf6_p4 until valid, to 12 uncertified",
            "",
            "",
            "10 s, 30 with Js < 0.5",
            {},
            "",
            "the paper: about 120 on 24 cores, 3 with Js < 0.5; prototype 5.3, 31"};
  Run run{"dlrf6_p4"};
  run.options.until = Until::Valid;
  run.options.threads = 1;
  Measured m;
  if (!bench.measure(line.what, run, m)) return;
  line.disturbed = m.conditions.disturbed();
  line.quality = quality_of(m) + text(", %lld with Js < 0.5", static_cast<long long>(m.below_half));
  if (m.times().few < 0) {
    line.measured = text("never; %.3g s", m.times().whole);
    line.missed.emplace_back("validity");
  } else {
    line.measured = text("%.3g s", m.times().few);
    check_seconds(m.normalised().few, 10, line);
  }
  if (m.below_half > 30) line.missed.emplace_back("quality");
  bench.table.add(line);
  Line whole{"dlrf6_p4 until valid, the whole run", text("%.3g s", m.times().whole),
             text("%.3g s", m.normalised().whole)};
  whole.disturbed = line.disturbed;
  bench.table.add(whole);
}

/// `js`: the goal for the lowest scaled Jacobian; `most`: seconds.
void worst(Bench& bench, const std::string& mesh, double js, double most) {
  Line line{mesh + ", --objective worst", "", "", text("%g s, min Js %.4f", most, js)};
  Run run = until_tolerance(mesh, 1e-6);
  run.options.constants = Constants::Standard;
  run.options.objective = Objective::Worst;
  Measured m;
  if (!bench.measure(line.what, run, m)) return;
  line.measured = text("%.3g s", m.times().whole);
  line.quality = quality_of(m);
  line.disturbed = m.conditions.disturbed();
  check_seconds(m.normalised().whole, most, line);
  constexpr double kRounded = 1e-4;  // the goal is known to four digits
  if (!(m.min_scaled_jacobian >= js - kRounded)) line.missed.emplace_back("min Js");
  bench.table.add(line);
}

void wing_to_tolerance(Bench& bench) {
  const int threads = static_cast<int>(std::min(2U, std::max(1U, std::thread::hardware_concurrency())));
  Line line{text("dlrf6_p4 to 1e-06, %d threads", threads), "", "", "40 s"};
  Run run = until_tolerance("dlrf6_p4", 1e-6);
  run.options.threads = threads;
  Measured m;
  if (!bench.measure(line.what, run, m)) return;
  line.measured = text("%.3g s", m.times().whole);
  line.quality = quality_of(m);
  line.disturbed = m.conditions.disturbed();
  line.judged = !line.disturbed;
  check_seconds(m.normalised().whole, 40, line);
  if (!m.converged) line.missed.emplace_back("not converged");
  bench.table.add(line);
}

// === Conjugate gradients ===

void iterations(Bench& bench) {
  double of_medium = 0;
  for (const auto& [mesh, tolerance] : {std::pair{"sph276_p5", 1e-5}, {"sph10k_p4", 1e-5}, {"sph120k_p4", 1e-3}}) {
    if (bench.small && mesh != std::string("sph276_p5")) break;
    Line line{mesh + std::string(", CG iterations per step")};
    Measured m;
    if (!bench.measure(line.what, until_tolerance(mesh, tolerance), m)) continue;
    line.measured = text("%.1f", m.products);
    double most = 25;
    line.target = "25";
    if (mesh == std::string("sph120k_p4") && of_medium > 0) {
      line.target += text(", and %.1f", 1.2 * of_medium);
      most = std::min(most, 1.2 * of_medium);
    }
    if (mesh == std::string("sph10k_p4")) of_medium = m.products;
    if (!(m.products > 0 && m.products <= most)) line.missed.emplace_back("iterations");
    line.peers = "prototype " + std::string(mesh == std::string("sph276_p5")   ? "24.3"
                                            : mesh == std::string("sph10k_p4") ? "21.6"
                                                                               : "20.2");
    bench.table.add(line);
  }
}

// === Other shapes ===

/// Flops per second, counted for this mesh.
struct Rates {
  double sweep = 0;      ///< Of only the sweep.
  double certified = 0;  ///< Of an iteration: the sweep, the scan of its cells, and certificates for those that moved.
  double busy = 0;       ///< The larger Conditions::busy_cores of the two.
};

/// Both rates are from the median of sweeps 2 to 6, by processor time.
Expected<Rates> rates_of(const Bench& bench, const std::string& mesh) {
  const Run run = six_sweeps(mesh, Energy::Hyperelastic);
  const auto loaded = bench.runner.meshes().load(mesh);
  if (!loaded) return tl::unexpected(loaded.error());
  Conditions conditions;
  const auto alone = in_child(
      [&] {
        SweepLoad load(*loaded, run.options);
        load.reset();
        std::vector<double> seconds;
        for (int i = 0; i < run.options.max_iterations; ++i) {
          const double start = processor_seconds();
          load.sweep();
          if (i > 0) seconds.push_back(processor_seconds() - start);
          load.scan();
        }
        return std::vector<double>{load.points() * flops_per_point(loaded->dimension) / median(seconds)};
      },
      Yardsticks::Spare, conditions);
  if (!alone) return tl::unexpected(alone.error());
  const auto whole = bench.runner.run_again(run);
  if (!whole) return tl::unexpected(whole.error());
  return Rates{alone->front(), whole->sweep_points * flops_per_point(whole->dimension) / whole->processor.sweep,
               std::max(conditions.busy_cores, whole->conditions.busy_cores)};
}

/// Adds one of the two lines that mixed() writes: how many times as long as at the rate of the tetrahedra.
void add_ratio(Bench& bench, const std::vector<double>& ratios, bool disturbed, Line line) {
  const double ratio = median(ratios);
  line.measured = text("%.2f", ratio);
  line.target = "1.5";
  line.disturbed = disturbed;
  if (!(ratio <= 1.5)) line.missed.emplace_back("time");
  bench.table.add(line);
}

void mixed(Bench& bench, const std::string& mesh, const char* peers) {
  const std::string tetrahedra = bench.small ? "sph276_p5" : "sph10k_p4";
  Line alone{mesh + ", a sweep against " + tetrahedra + "'s rate"}, with{mesh + ", the same with certificates"};
  Measured m;
  if (!bench.measure(alone.what, six_sweeps(mesh, Energy::Hyperelastic), m)) return;
  // Measured in pairs, so that changes in the machine's speed affect both alike.
  std::vector<double> ratios, certified, busy;
  for (int pair = 0; pair < kPairs; ++pair) {
    const auto theirs = rates_of(bench, tetrahedra), own = rates_of(bench, mesh);
    if (!theirs || !own) return bench.table.fail(alone.what, theirs ? own.error() : theirs.error());
    ratios.push_back(theirs->sweep / own->sweep);
    certified.push_back(theirs->certified / own->certified);
    busy.push_back(std::max(theirs->busy, own->busy));
  }
  const bool disturbed = Conditions{0, median(busy)}.disturbed();
  alone.peers = peers;
  add_ratio(bench, ratios, disturbed, alone);
  with.normalised = text("%.3g s", m.normalised().sweep);
  with.quality = quality_of(m);
  add_ratio(bench, certified, disturbed || m.conditions.disturbed(), with);
}

}  // namespace

const std::vector<Row> kCaseRows{
    {"sweep.hyperelastic", When::Full,
     [](Bench& b) { sweep(b, "sph10k_p4", Energy::Hyperelastic, 0.12, kSpherePeers); }},
    {"sweep.linear-elastic", When::Full, [](Bench& b) { sweep(b, "sph10k_p4", Energy::LinearElastic, 0.15, ""); }},
    {"sweep.winslow", When::Full, [](Bench& b) { sweep(b, "sph10k_p4", Energy::Winslow, 0.15, ""); }},
    {"sweep.distortion", When::Full, [](Bench& b) { sweep(b, "sph10k_p4", Energy::Distortion, 0.15, ""); }},
    {"sweep.circ10k_p5", When::Full,
     [](Bench& b) {
       sweep(b, "circ10k_p5", Energy::Hyperelastic, 0.04,
             "NekMesh 0.99, its later design 0.15 to 0.45, prototype 0.13");
     }},
    {"converge.sph276_p5", When::Short,
     [](Bench& b) {
       converge(b, "sph276_p5", {1e-5, 0, 0.12, 0.675, 0.003},
                "NekMesh 31.4 (.677), its later design 13.4 (.689), MFEM 17 (.600), gmsh 2.9 (.463), prototype 0.10");
     }},
    {"converge.sph10k_p4", When::Full,
     [](Bench& b) {
       converge(b, "sph10k_p4", {1e-5, 0, 2.5, 0.838, 0.002},
                "MFEM 78 (.661), gmsh 56 (.779), neither converged; prototype 2.5 to 2.9");
     }},
    {"converge.circ10k_p5", When::Full,
     [](Bench& b) {
       converge(b, "circ10k_p5", {1e-5, 0, 0.7, 0.968, 0.002}, "MFEM 67 (.961), gmsh 25 (.955), prototype 0.71");
     }},
    {"converge.sph120k_p4", When::Full, converge_large},
    {"untangle.dlrf6_p4", When::Full, untangle_wing},
    {"converge.dlrf6_p4", When::Full, wing_to_tolerance},
    {"worst.sph10k_p4", When::Full, [](Bench& b) { worst(b, "sph10k_p4", 0.9175, 12); }},
    {"worst.circ10kc_p5", When::Full, [](Bench& b) { worst(b, "circ10kc_p5", 0.9966, 4); }},
    {"stiff.sph10k_p4", When::Full,
     [](Bench& b) {
       converge(b, "sph10k_p4", {1e-5, 10, 4.5, 0, 0}, "prototype 4.7 (.895)");
     }},
    {"stiff.circ10k_p5", When::Full,
     [](Bench& b) {
       converge(b, "circ10k_p5", {1e-5, 10, 1.3, 0, 0}, "prototype 1.39 (.990)");
     }},
    {"mixed.sphhex_p3", When::Short,
     [](Bench& b) { mixed(b, "sphhex_p3", "NekMesh aborts; MFEM killed after 164, gmsh killed"); }},
    {"mixed.sphbl_p2", When::Short,
     [](Bench& b) { mixed(b, "sphbl_p2", "to the end: NekMesh 29.9, 22 invalid; its later design 8.1, 2 invalid"); }},
    {"mixed.annquad_p4", When::Short,
     [](Bench& b) { mixed(b, "annquad_p4", "to the end: NekMesh 16, its later design 3.7, MFEM 0.42, gmsh 0.6"); }},
    {"mixed.cylprism_p2", When::Short, [](Bench& b) { mixed(b, "cylprism_p2", "NekMesh, gmsh: 8 invalid left"); }},
    {"iterations", When::Short, iterations},
};

}  // namespace varimesh::bench
