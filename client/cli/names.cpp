// The rule is stated in the proto: the constant without the enum's name, in lower case, with dashes.
#include "client/cli/names.h"

#include <algorithm>
#include <cctype>

namespace varimesh::client {
namespace {

/// "JobState" becomes "JOB_STATE_".
std::string prefix_of(const google::protobuf::EnumDescriptor& type) {
  std::string prefix;
  for (const char c : type.name()) {
    if (std::isupper(static_cast<unsigned char>(c)) && !prefix.empty()) prefix += '_';
    prefix += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return prefix + '_';
}

}  // namespace

std::string dashed(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

std::string spelled(const google::protobuf::EnumValueDescriptor& value) {
  const std::string prefix = prefix_of(*value.type());
  std::string name = value.name().rfind(prefix, 0) == 0 ? value.name().substr(prefix.size()) : value.name();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return dashed(name);
}

std::vector<std::string> spellings(const google::protobuf::EnumDescriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.value_count(); ++i)
    if (type.value(i)->number() != 0) names.push_back(spelled(*type.value(i)));
  return names;
}

const google::protobuf::EnumValueDescriptor* value_of(const google::protobuf::EnumDescriptor& type,
                                                      const std::string& spelling) {
  for (int i = 0; i < type.value_count(); ++i)
    if (type.value(i)->number() != 0 && spelled(*type.value(i)) == spelling) return type.value(i);
  return nullptr;
}

}  // namespace varimesh::client
