#include "core/formats/hdf5/notes.h"

#include <sstream>

namespace varimesh::formats {

namespace {

constexpr const char* kSection = "BCType";
constexpr const char* kTypes = "BoundaryConditionTypes";

}  // namespace

void remember_hopr_conditions(HighOrderMesh& mesh, const std::map<int, HoprCondition>& conditions) {
  std::ostringstream text;
  for (const auto& [tag, condition] : conditions) {
    text << tag;
    for (const std::int32_t number : condition) text << ' ' << number;
    text << '\n';
  }
  mesh.foreign.push_back({kSection, text.str(), "hopr"});
}

std::map<int, HoprCondition> hopr_conditions_of(const HighOrderMesh& mesh) {
  std::map<int, HoprCondition> all;
  for (const ForeignSection& section : mesh.foreign) {
    if (section.name != kSection || section.format != "hopr") continue;
    std::istringstream text(section.bytes);
    HoprCondition condition{};
    for (int tag = 0; text >> tag >> condition[0] >> condition[1] >> condition[2] >> condition[3];)
      all[tag] = condition;
  }
  return all;
}

void remember_cgns_types(HighOrderMesh& mesh, const std::map<int, std::string>& types) {
  if (types.empty()) return;
  std::string text;
  for (const auto& [tag, type] : types) text += std::to_string(tag) + " " + type + "\n";
  mesh.foreign.push_back({kTypes, text, "cgns"});
}

std::map<int, std::string> cgns_types_of(const HighOrderMesh& mesh) {
  std::map<int, std::string> types;
  for (const ForeignSection& section : mesh.foreign) {
    if (section.name != kTypes || section.format != "cgns") continue;
    std::istringstream text(section.bytes);
    std::string type;
    for (int tag = 0; text >> tag >> type;) types[tag] = type;
  }
  return types;
}

}  // namespace varimesh::formats
