// The yardstick that times are normalised by: a product of two 1024 × 1024 matrices on one thread, compiled for this
// very machine. Figures in issues and documentation are for 82 GFLOP/s.
#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cstdio>

int main() {
  constexpr int n = 1024;
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(n, n), b = Eigen::MatrixXd::Random(n, n);
  Eigen::MatrixXd c(n, n);
  double best = 1e300;
  for (int i = 0; i < 20; ++i) {
    const auto start = std::chrono::steady_clock::now();
    c.noalias() = a * b;
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::printf("%.1f GFLOP/s (%g)\n", 2.0 * n * n * n / best * 1e-9, c(0, 0));
}
