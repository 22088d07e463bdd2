// varimesh_cad_reader: reads a CAD file in a process of its own, so that a damaged file which makes OpenCASCADE crash,
// hang or fill the memory ends only this process. core/geometry/cad_reader.cpp starts it.
//
//   varimesh_cad_reader SECONDS BYTES [triangles]
//
// The file is descriptor 5. The program writes the shape in OpenCASCADE's binary format to descriptor 3, or, with the
// word "triangles", its faces as core/geometry/cad/model_triangles.h encodes them. Lines about what it took go to
// descriptor 4. Descriptor 6 gets a line for each face that has a name: its number, a space and the name. If the file
// cannot be used, descriptor 4 gets the sentence that says why, and the exit status is 3. SECONDS of processor time and
// BYTES of memory are its limits; 0: none.
#include <BinTools.hxx>
#include <Standard_Failure.hxx>
#include <cstdlib>
#include <exception>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/io/write_all.h"
#include "core/opencascade/shapes.h"
#include "core/opencascade/triangulate.h"
#include "core/process/sandbox.h"

namespace {

constexpr int kShape = 3, kSentence = 4, kInput = 5, kNames = 6;
constexpr const char* kFile = "/proc/self/fd/5";

int refuse(const std::string& sentence) {
  varimesh::write_all(kSentence, sentence);
  return 3;
}

/// Hands over what was made of the file, and the facts about it.
int hand_over(std::string_view made, const varimesh::cad::FileFacts& facts) {
  if (!varimesh::write_all(kShape, made))
    return refuse("its shape cannot be handed over, because there is not enough memory.");
  std::string names;
  for (const auto& [number, name] : facts.names) names += std::to_string(number) + " " + name + "\n";
  varimesh::write_all(kNames, names);
  varimesh::write_all(kSentence, facts.notes);
  return 0;
}

int read(bool as_triangles) {
  TopoDS_Shape shape;
  std::string error;
  varimesh::cad::FileFacts facts;
  if (!varimesh::cad::read_shape(kFile, shape, facts, error)) return refuse(error);
  if (as_triangles) {
    facts.notes = varimesh::cad::parts_note(shape, facts.has_unit) + facts.notes + facts.loose;
    std::vector<varimesh::geometry::FaceTriangles> faces;
    if (!varimesh::cad::triangulate(shape, faces, facts.notes, error)) return refuse(error);
    return hand_over(varimesh::geometry::encode(faces), facts);
  }
  facts.notes += facts.bodies + facts.loose;
  // The shapes are made and looked at here too, so that what they crash on is found in this process.
  varimesh::geometry::Geometry rehearsal;
  if (!varimesh::cad::build(shape, rehearsal, error)) return refuse(error);
  (void)varimesh::geometry::size(rehearsal);
  for (const auto& surface : rehearsal.surfaces)
    (void)surface.shape->contains(surface.shape->u_range().first, surface.shape->v_range().first);
  std::ostringstream out;
  BinTools::Write(shape, out);
  if (!out) return refuse("its shape cannot be handed over, because there is not enough memory.");
  return hand_over(out.view(), facts);
}

}  // namespace

int main(int argc, char** argv) {
  const bool as_triangles = argc == 4 && std::string_view(argv[3]) == "triangles";
  if (argc != 3 && !as_triangles) return 2;
  varimesh::begin_confinement();
  varimesh::Confinement keeps;
  keeps.processor_seconds = std::strtoll(argv[1], nullptr, 10);
  keeps.memory = std::strtoll(argv[2], nullptr, 10);
  keeps.file_bytes = keeps.memory > 0 ? keeps.memory : std::numeric_limits<std::int64_t>::max();
  constexpr int kOpenAtOnce = 4;
  keeps.more_descriptors = kOpenAtOnce;
  // OpenCASCADE reads IGES files by their names only.
  keeps.path = kFile;
  keeps.file = kInput;
  (void)varimesh::confine_this_process(keeps);  // without filters, the process of its own and its limits protect
  try {
    return read(as_triangles);
  } catch (const Standard_Failure& failure) {
    return refuse(std::string("OpenCASCADE gave up (") + failure.GetMessageString() + "); export it again, as STEP.");
  } catch (const std::exception& failure) {
    return refuse(std::string("it is too large or damaged (") + failure.what() + ").");
  }
}
