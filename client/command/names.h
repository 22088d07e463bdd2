// How the contract's enums are spelled in flags and documents: ENERGY_LINEAR_ELASTIC is linear-elastic.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>

#include <string>
#include <vector>

namespace varimesh::client {

/// The user's spelling of an enum's value.
std::string spelled(const google::protobuf::EnumValueDescriptor& value);
/// All values but UNSPECIFIED, spelled.
std::vector<std::string> spellings(const google::protobuf::EnumDescriptor& type);
/// The value of that spelling, or null.
const google::protobuf::EnumValueDescriptor* value_of(const google::protobuf::EnumDescriptor& type,
                                                      const std::string& spelling);

/// The spelling of a generated enum's value; empty where the number is not known.
template <class Enum>
std::string spelled(Enum value) {
  const auto* found = google::protobuf::GetEnumDescriptor<Enum>()->FindValueByNumber(static_cast<int>(value));
  return found == nullptr ? std::string() : spelled(*found);
}

/// A field's name as a flag, without the leading dashes: max_iterations is max-iterations.
std::string dashed(std::string name);

}  // namespace varimesh::client
