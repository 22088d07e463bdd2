// How a run is stopped, and the short time that it has left then.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/base/stop_token.h"
#include "core/base/team.h"
#include "core/optimise/result.h"
#include "core/quality/certified_quality.h"
#include "core/ranks/stop_together.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// What has to be done at the end of a run is done thoroughly as long as there is time, and then quickly. No function
/// may be called inside team.run().
class Grace {
 public:
  /// `stop` is the token of the run, and `cells` the number of cells of the mesh. `ranks`: that share the run, and call
  /// everything together; `stop` is a token of all of them.
  Grace(Team& team, StopToken& stop, std::size_t cells, const Ranks& ranks = one_rank())
      : team_(team), stop_(stop), seconds_(kSeconds + kSecondsPerCell * static_cast<double>(cells)), ranks_(ranks) {
    stop_together(left_, ranks);
  }

  /// From now on the team looks at the token of the run.
  void watch() { team_.set_stop(&stop_); }
  /// The token stops the run in this many seconds.
  void stop_after(double seconds) { stop_.stop_after(seconds); }
  /// Whether a look has found that the run is to stop.
  bool stopped() const { return stop_.reason() != StopToken::Reason::None; }

  /// The run is stopped: from now on the team looks at a token that leaves it the time of grace.
  void begin() {
    if (has_begun()) return;
    left_.stop_after(seconds_);
    team_.set_stop(&left_);
  }

  /// Does `thorough`. If the token of the run interrupts that, does it again in the time of grace. If that ends too,
  /// does `quick`, which must not look.
  template <class Thorough, class Quick>
  void finish(const Thorough& thorough, const Quick& quick) {
    const bool had_begun = has_begun();
    if (is_done(thorough)) return;
    begin();
    if (had_begun || !is_done(thorough)) quick();
  }

  /// Says in the summary that the token has ended the run.
  void say_stopped(RunSummary& summary) const {
    summary.converged = false;
    summary.stopped = stop_.reason() == StopToken::Reason::Asked;
    summary.stop_reason = summary.stopped ? StopReason::Stopped : StopReason::TimeLimit;
  }

 private:
  /// A run ends within 0.5 s and 0.1 s per 100,000 cells. More than half of this is for the time until a look and for
  /// what is done quickly: copies of the mesh, its coordinates from the solver's nodes, samples on the coarse lattice.
  static constexpr double kSeconds = 0.2, kSecondsPerCell = 0.4e-6;

  bool has_begun() const { return team_.stop() == &left_; }

  template <class Work>
  bool is_done(const Work& work) {
    try {
      // All ranks begin it or none does, however long each then works before it looks.
      if (ranks_.count() > 1) team_.look_together();
      work();
      return true;
    } catch (const Interrupted&) {
      return false;
    }
  }

  Team& team_;
  StopToken& stop_;
  double seconds_;
  const Ranks& ranks_;
  StopToken left_;
};

/// The quality report of a run that may be stopped. `certificates` are those of `certifier` for mesh.coordinates. Not
/// inside team.run(). `elsewhere` as in certified_quality.h.
inline QualityReport report_quality(const HighOrderMesh& mesh, const Certifier& certifier,
                                    const std::vector<Certificate>& certificates, const Team& team, Grace& grace,
                                    detail::SamplesElsewhere* elsewhere = nullptr) {
  QualityReport report;
  grace.finish([&] { report = quality(mesh, certifier, certificates, 0, team, one_rank(), elsewhere); },
               [&] { report = quick_quality(mesh, certificates, team); });
  return report;
}

}  // namespace varimesh
