// Asks the yardstick how fast this machine is now.
#pragma once

#include <cstdio>
#include <vector>

namespace varimesh::bench {

/// What figures are normalised to: seconds × yardstick ÷ this.
inline constexpr double kReferenceGflops = 82;

/// What a yardstick says, in GFLOP/s; 0 where it does not run.
struct Yardstick {
  double wall = 0;
  double processor = 0;  ///< By processor time: hardly disturbed by what else runs.
};

/// So many yardsticks at the same time, one thread each.
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
