// Keeps the types of CGNS's boundary conditions with the mesh.
#include <sstream>

#include "core/formats/cgns/cgns.h"

namespace varimesh::formats {

namespace {

constexpr const char* kTypes = "BoundaryConditionTypes";

}  // namespace

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
