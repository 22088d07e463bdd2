// varimesh_cad_reader: reads a CAD file in a process of its own, so that a damaged file which makes OpenCASCADE crash,
// hang or fill the memory ends only this process. core/geometry/load.cpp starts it.
//
//   varimesh_cad_reader FILE SECONDS BYTES
//
// It writes the shape in OpenCASCADE's binary format to descriptor 3, and nothing if the file cannot be used; then the
// sentence goes to descriptor 4. SECONDS of processor time and BYTES of memory are its limits; 0: none.
#include <sys/prctl.h>
#include <sys/resource.h>

#include <BinTools.hxx>
#include <Standard_Failure.hxx>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <fstream>

#include "core/opencascade/shapes.h"

namespace {

void limit(int what, const char* most) {
  const rlim_t value = std::strtoull(most, nullptr, 10);
  const rlimit limits{value, value};
  if (value > 0) setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

int refuse(const std::string& sentence) {
  std::ofstream("/proc/self/fd/4") << sentence;
  return 3;
}

int read(const std::string& path) {
  TopoDS_Shape shape;
  std::string error;
  if (!varimesh::cad::read_shape(path, shape, error)) return refuse(error);
  // The shapes are made and looked at here too, so that what they crash on is found in this process.
  varimesh::geometry::Geometry rehearsal;
  if (!varimesh::cad::build(shape, rehearsal, error)) return refuse(error);
  (void)varimesh::geometry::size(rehearsal);
  for (const auto& surface : rehearsal.surfaces)
    (void)surface.shape->contains(surface.shape->u_range().first, surface.shape->v_range().first);
  std::ofstream out("/proc/self/fd/3", std::ios::binary);
  BinTools::Write(shape, out);
  out.flush();
  return out ? 0 : refuse("its shape cannot be handed over, because there is not enough memory.");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // whoever waits for the shape is gone
  limit(RLIMIT_CPU, argv[2]);
  limit(RLIMIT_AS, argv[3]);
  limit(RLIMIT_CORE, "1");
  try {
    return read(argv[1]);
  } catch (const Standard_Failure& failure) {
    return refuse(std::string("OpenCASCADE gave up (") + failure.GetMessageString() + "); export it again, as STEP.");
  } catch (const std::exception& failure) {
    return refuse(std::string("it is too large or damaged (") + failure.what() + ").");
  }
}
