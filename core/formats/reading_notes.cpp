#include "core/formats/reading_notes.h"

#include <algorithm>
#include <sstream>

#include "core/formats/common/reading_notes.h"

namespace varimesh::formats {

namespace {

constexpr const char *kNotes = "notes of reading", *kSerendipity = "serendipity";
// No format has this name.
constexpr const char* kOfNoFormat = "";

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
  const auto note = std::ranges::find_if(mesh.foreign, [](const ForeignSection& section) {
    return is_reading_note(section) && section.name == kSerendipity;
  });
  if (note == mesh.foreign.end()) return {};
  std::istringstream text(note->bytes);
  int order = 0;
  std::vector<Shape> shapes;
  text >> order;
  for (int shape = 0; text >> shape;) shapes.push_back(Shape(shape));
  return order == mesh.order ? shapes : std::vector<Shape>();
}

}  // namespace varimesh::formats
