#include "client/library/random_id.h"

#include <array>
#include <cstdio>
#include <random>

namespace varimesh::client {

std::string random_id() {
  std::random_device device;
  std::string id;
  for (int i = 0; i < 4; ++i) {
    std::array<char, 9> digits{};
    std::snprintf(digits.data(), digits.size(), "%08x", static_cast<unsigned>(device()));
    id += digits.data();
  }
  return id;
}

}  // namespace varimesh::client
