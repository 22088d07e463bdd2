// Runs the yardstick, which measures how fast this machine is at the moment.
#pragma once

#include <cstdio>
#include <vector>

namespace varimesh::bench {

/// Figures are normalised to this speed, in GFLOP/s: seconds × yardstick ÷ kReferenceGflops.
inline constexpr double kReferenceGflops = 82;

/// The result of a yardstick in GFLOP/s; 0 if it could not be run.
struct Yardstick {
  double wall = 0;       ///< By wall-clock time.
  double processor = 0;  ///< By processor time, which other programs hardly disturb.
};

/// Runs `count` yardsticks at the same time, with one thread each.
inline std::vector<Yardstick> yardsticks(int count) {
  std::vector<std::FILE*> running;
  for (int i = 0; i < count; ++i) running.push_back(popen(VARIMESH_YARDSTICK, "r"));
  std::vector<Yardstick> all;
  for (std::FILE* one : running) {
    Yardstick said;
    if (one == nullptr || std::fscanf(one, "%lf GFLOP/s, %lf", &said.wall, &said.processor) != 2) said = {};
    if (one != nullptr) pclose(one);
    all.push_back(said);
  }
  return all;
}

inline Yardstick yardstick() { return yardsticks(1)[0]; }

}  // namespace varimesh::bench
