// The yardstick by which times are normalised: a product of two 1024 × 1024 matrices on one thread, compiled for this
// machine; the best of ten. The figures in the documentation are for 82 GFLOP/s. Prints GFLOP/s by wall-clock time and
// by processor time, which are the same if nothing else runs.
#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>

namespace {

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

int main() {
  constexpr int n = 1024;
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(n, n), b = Eigen::MatrixXd::Random(n, n);
  Eigen::MatrixXd c(n, n);
  double best = 1e300, best_processor = 1e300;
  for (int i = 0; i < 10; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const double processor_start = processor_seconds();
    c.noalias() = a * b;
    best_processor = std::min(best_processor, processor_seconds() - processor_start);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  constexpr double gflop = 2e-9 * n * n * n;
  std::printf("%.1f GFLOP/s, %.1f by processor time (%g)\n", gflop / best, gflop / best_processor, c(0, 0));
}
