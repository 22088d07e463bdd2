// Seconds and nanoseconds since 1970.
#include "server/jobs/timestamps.h"

namespace varimesh::server {

google::protobuf::Timestamp timestamp(std::chrono::system_clock::time_point time) {
  const auto nanoseconds = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
  google::protobuf::Timestamp result;
  result.set_seconds(nanoseconds / 1'000'000'000);
  result.set_nanos(static_cast<std::int32_t>(nanoseconds % 1'000'000'000));
  return result;
}

std::chrono::system_clock::time_point time_point(const google::protobuf::Timestamp& time) {
  return std::chrono::system_clock::time_point(std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::seconds(time.seconds()) + std::chrono::nanoseconds(time.nanos())));
}

}  // namespace varimesh::server
