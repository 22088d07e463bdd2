// How the enums of the proto are spelled in flags and documents: ENERGY_LINEAR_ELASTIC is linear-elastic.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>

#include <string>
#include <vector>

namespace varimesh::client {

/// The spelling of an enum's value.
std::string spelled(const google::protobuf::EnumValueDescriptor& value);
/// The spellings of all values except UNSPECIFIED.
std::vector<std::string> spellings(const google::protobuf::EnumDescriptor& type);
/// The value with this spelling, or null.
const google::protobuf::EnumValueDescriptor* value_of(const google::protobuf::EnumDescriptor& type,
                                                      const std::string& spelling);

/// The spelling of a generated enum's value; empty if the enum has no such number.
template <class Enum>
std::string spelled(Enum value) {
  const auto* found = google::protobuf::GetEnumDescriptor<Enum>()->FindValueByNumber(static_cast<int>(value));
  return found == nullptr ? std::string() : spelled(*found);
}

/// The name of a field as a flag has it, without the leading dashes: max_iterations becomes max-iterations.
std::string dashed(std::string name);

}  // namespace varimesh::client
