// How long a run will still take, judged from the method itself.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>

#include "core/forecast/past_forecasts.h"
#include "core/options/options.h"

namespace varimesh {

/// Forecasts the end of a run from what its method has done so far and what it usually does next. What is left is the
/// sum of the rest of the energy's methods, of the rounds that lower the loss of accuracy, and of other ways that are
/// tried for elements that stay invalid. Of each, some is known: rounds end when they move nodes no more, and each
/// moves them less than the one before; other ways may take a multiple of the run. What is not known is taken from runs
/// that were measured (docs/notes/time-left.md has the figures, and says how often they are wrong).
///
/// All times are in seconds since the run began, so nothing here reads a clock.
class Forecast {
 public:
  enum class Goal { Energy, Minimum, Loss };
  struct Rules {
    Goal goal = Goal::Loss;
    bool only_sweeps = false;  ///< No other method follows sweeps.
    double tolerance = 1e-3;   ///< The residual at which Newton's method and sweeps end.
    double time_limit = 0;     ///< 0: none.
  };
  static Rules rules_of(const Options& options);
  explicit Forecast(const Rules& rules) : rules_(rules) {}

  /// The mesh as it came was judged in this time. The result will be judged, too.
  void judged_in(double seconds) { end_ = seconds; }

  /// From `now` on, a stage iterates.
  void begin(double now) { last_ = now; }

  /// What the mesh is like at this moment.
  struct State {
    double now = 0;
    bool is_valid = false;  ///< All cells are certified valid.
    bool hopes = false;     ///< If the run ended so, other ways would be tried for what is left.
  };
  enum class Method { Sweep, Newton, Untangle };
  /// An iteration has ended. `residual`: as in Iteration.
  void step(Method method, double residual, const State& state);

  /// From `now` on, a descent begins.
  void descent(double now);
  /// A round of a descent has ended.
  /// @param move     how far nodes moved
  /// @param rest     the rounds end if all further ones together move no node as far as this
  /// @param another  as it looks now, another descent will follow this one
  void round(double move, double rest, bool another, const State& state);

  /// Another way begins at `now`. At most `ways` are tried from here on, this one included.
  void other_way(double now, int ways);

  /// The way that has just begun, at `now`, is a whole run with rules of its own, which counts its seconds from now on.
  /// @return the forecast that this run tells what it does; it lives until the next way begins
  Forecast& whole_run(double now, const Rules& rules);

  /// What follows is not known to the forecast.
  void forget() { left_.reset(); }

  /// The seconds that are left at this time, or nothing if nobody can tell. Nobody can if what was said so far was
  /// wrong, and once the run has lasted longer than was said.
  std::optional<double> seconds_left(double now) const;

 private:
  /// The last few times that something took, and the sizes that it left: residuals, or how far nodes moved.
  class Last {
   public:
    void add(double seconds, double size);
    void clear() { seen_.clear(); }
    std::size_t count() const { return seen_.size(); }
    /// The mean of the last few times; 0 if there are none.
    double mean(std::size_t of) const;
    /// The factor by which the size falls each time, from the last few; 1 if it has not fallen.
    double ratio(std::size_t of) const;

   private:
    struct Seen {
      double seconds, size;
    };
    std::deque<Seen> seen_;
  };

  /// How long a Newton step takes, also before there was any.
  double newton_time() const;
  /// What the energy's methods still do while cells are not certified valid.
  double left_of_invalid() const;
  double left_of_sweeps(double residual, bool is_valid) const;
  double left_of_newton(double residual, bool is_valid) const;
  /// What comes after the energy's methods, before other ways.
  double after_energy(bool is_valid) const;
  double left_of_rounds(double move, double rest, const State& state) const;
  void expect(double left, const State& state);
  /// How long each other way takes, as it looks now.
  double way_time() const;
  /// The longest that other ways may still take: their work has a bound.
  double most_of_ways(double now) const;

  const Rules rules_;
  double end_ = 0;
  double last_ = 0;  ///< When the last iteration ended.
  Last sweeps_, newton_, untangling_, rounds_;
  int newton_steps_ = 0, all_rounds_ = 0;
  double descent_began_ = 0;
  double last_descent_ = 0;  ///< How long the descent before took; 0: there was none.
  double run_ = 0;           ///< How long the run took before other ways.
  int ways_ = 0;             ///< Other ways that are left, with the present one; 0: none was begun.
  Last ended_ways_;
  double way_began_ = 0;
  double ways_began_ = 0;  ///< Later by the time of whole runs, which the bound of the ways does not count.
  std::unique_ptr<Forecast> whole_run_;
  std::optional<double> left_;  ///< At left_at_.
  double left_at_ = 0;
  PastForecasts past_;
};

}  // namespace varimesh
