// Conversion between points in time and the messages of the contract.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <chrono>
#include <cstdint>

namespace varimesh::server {

google::protobuf::Timestamp timestamp(std::chrono::system_clock::time_point time);
std::chrono::system_clock::time_point time_point(const google::protobuf::Timestamp& time);

/// Nanoseconds since 1970.
inline std::int64_t nanoseconds(std::chrono::system_clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}
inline std::chrono::system_clock::time_point from_nanoseconds(std::int64_t count) {
  return std::chrono::system_clock::time_point(
      std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::nanoseconds(count)));
}

}  // namespace varimesh::server
