#include "server/fetch/public_address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstdint>

namespace varimesh::server {
namespace {

/// The addresses whose first `bits` bits are those of `first`.
struct Block {
  std::array<std::uint8_t, 16> first;
  int bits;
};

constexpr std::array kSpecialV4 = {
    Block{{0}, 8},             // this network
    Block{{10}, 8},            // private
    Block{{100, 64}, 10},      // shared by customers of a provider
    Block{{127}, 8},           // loopback
    Block{{169, 254}, 16},     // link-local; clouds hand out credentials there
    Block{{172, 16}, 12},      // private
    Block{{192, 0, 0}, 24},    // protocols
    Block{{192, 0, 2}, 24},    // documentation
    Block{{192, 88, 99}, 24},  // 6to4 relays
    Block{{192, 168}, 16},     // private
    Block{{198, 18}, 15},      // benchmarks
    Block{{198, 51, 100}, 24},
    Block{{203, 0, 113}, 24},  // documentation
    Block{{224}, 3},           // multicast and reserved
};

constexpr Block kGlobalV6{{0x20}, 3};
constexpr std::array kSpecialV6 = {
    Block{{0x20, 0x01, 0x00}, 23},        // protocols, Teredo
    Block{{0x20, 0x01, 0x0d, 0xb8}, 32},  // documentation
    Block{{0x20, 0x02}, 16},              // 6to4
    Block{{0x3f, 0xff, 0x00}, 20},        // documentation
};

bool is_in(const std::uint8_t* address, const Block& block) {
  for (int bit = 0; bit < block.bits; bit += 8) {
    const int left = std::min(8, block.bits - bit);
    const auto mask = static_cast<std::uint8_t>(0xff << (8 - left));
    const auto byte = static_cast<std::size_t>(bit / 8);
    if (((address[byte] ^ block.first[byte]) & mask) != 0) return false;
  }
  return true;
}

template <std::size_t n>
bool is_in_any(const std::uint8_t* address, const std::array<Block, n>& blocks) {
  return std::ranges::any_of(blocks, [&](const Block& block) { return is_in(address, block); });
}

}  // namespace

bool is_public(const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    return !is_in_any(reinterpret_cast<const std::uint8_t*>(&v4.sin_addr), kSpecialV4);
  }
  if (address.sa_family != AF_INET6) return false;
  const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
  return is_in(v6.sin6_addr.s6_addr, kGlobalV6) && !is_in_any(v6.sin6_addr.s6_addr, kSpecialV6);
}

}  // namespace varimesh::server
