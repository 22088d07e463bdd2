#include "core/formats/reading_notes.h"

#include <algorithm>
#include <sstream>
#include <string_view>

#include "core/formats/common/reading_notes.h"

namespace varimesh::formats {

namespace {

constexpr const char *kNotes = "notes of reading", *kSerendipity = "serendipity", *kLower = "lower orders",
                     *kKeepOrders = "keep orders";
// No format has this name.
constexpr const char* kOfNoFormat = "";

/// Null if there is none.
const ForeignSection* find_note(const HighOrderMesh& mesh, std::string_view name) {
  const auto note = std::ranges::find_if(
      mesh.foreign, [&](const ForeignSection& section) { return is_reading_note(section) && section.name == name; });
  return note == mesh.foreign.end() ? nullptr : &*note;
}

}  // namespace

bool is_reading_note(const ForeignSection& section) { return section.format == kOfNoFormat; }

void note_reading(HighOrderMesh& mesh, const std::vector<std::string>& sentences) {
  for (const std::string& sentence : sentences) mesh.foreign.push_back({kNotes, sentence, kOfNoFormat});
}

std::vector<std::string> reading_notes(const HighOrderMesh& mesh) {
  std::vector<std::string> sentences;
  for (const ForeignSection& section : mesh.foreign)
    if (is_reading_note(section) && section.name == kNotes) sentences.push_back(section.bytes);
  return sentences;
}

void remember_serendipity(HighOrderMesh& mesh, const std::vector<Shape>& shapes) {
  if (shapes.empty()) return;
  std::string text = std::to_string(mesh.order);
  for (const Shape shape : shapes) text += " " + std::to_string(int(shape));
  mesh.foreign.push_back({kSerendipity, text, kOfNoFormat});
}

std::vector<Shape> serendipity_of(const HighOrderMesh& mesh) {
  const ForeignSection* note = find_note(mesh, kSerendipity);
  if (note == nullptr) return {};
  std::istringstream text(note->bytes);
  int order = 0;
  std::vector<Shape> shapes;
  text >> order;
  for (int shape = 0; text >> shape;) shapes.push_back(Shape(shape));
  return order == mesh.order ? shapes : std::vector<Shape>();
}

void remember_lower(HighOrderMesh& mesh, const std::vector<CameLower>& lower) {
  if (lower.empty()) return;
  std::string text = std::to_string(mesh.order);
  for (const CameLower& run : lower)
    text += " " + std::to_string(run.first) + " " + std::to_string(run.last) + " " + std::to_string(run.dimension) +
            " " + std::to_string(run.order) + (run.serendipity ? " 1" : " 0");
  mesh.foreign.push_back({kLower, text, kOfNoFormat});
}

std::vector<CameLower> lower_of(const HighOrderMesh& mesh) {
  const ForeignSection* note = find_note(mesh, kLower);
  if (note == nullptr || find_note(mesh, kKeepOrders) == nullptr) return {};
  std::istringstream text(note->bytes);
  int order = 0;
  text >> order;
  std::vector<CameLower> lower;
  for (CameLower run; text >> run.first >> run.last >> run.dimension >> run.order >> run.serendipity;)
    lower.push_back(run);
  return order == mesh.order ? lower : std::vector<CameLower>();
}

bool keep_orders(HighOrderMesh& mesh) {
  if (find_note(mesh, kKeepOrders) == nullptr) mesh.foreign.push_back({kKeepOrders, "", kOfNoFormat});
  return find_note(mesh, kLower) != nullptr;
}

}  // namespace varimesh::formats
