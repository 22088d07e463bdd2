// Seconds and nanoseconds since 1970.
#include "server/jobs/timestamps.h"

namespace varimesh::server {

google::protobuf::Timestamp timestamp(std::chrono::system_clock::time_point time) {
  const std::int64_t count = nanoseconds(time);
  google::protobuf::Timestamp result;
  result.set_seconds(count / 1'000'000'000);
  result.set_nanos(static_cast<std::int32_t>(count % 1'000'000'000));
  return result;
}

std::chrono::system_clock::time_point time_point(const google::protobuf::Timestamp& time) {
  return from_nanoseconds(time.seconds() * 1'000'000'000 + time.nanos());
}

}  // namespace varimesh::server
