// Conversion between points in time and the messages of the contract.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <chrono>

namespace varimesh::server {

google::protobuf::Timestamp timestamp(std::chrono::system_clock::time_point time);
std::chrono::system_clock::time_point time_point(const google::protobuf::Timestamp& time);

}  // namespace varimesh::server
