// h5py, VTK and libcgns read the HDF5 files, as separate programs, and see the same mesh. What is not installed is
// skipped, with a sentence.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <iomanip>
#include <sstream>

#include "core/reference/quadrature.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::Filling;

bool python_can(const std::string& import) {
  return std::system(("/usr/bin/python3 -c '" + import + "' >/dev/null 2>&1").c_str()) == 0;
}

/// The area of the six sides of the unit cube under the map below, by Gauss's rule with 40 points per direction on
/// |∂X/∂u × ∂X/∂v|.
double area_of_bent_cube() {
  const auto [points, weights] = reference::gauss_jacobi(40, 0, 0);
  double area = 0;
  for (Eigen::Index i = 0; i < points.size(); ++i)
    for (Eigen::Index j = 0; j < points.size(); ++j) {
      const double u = (1 + points(i)) / 2, v = (1 + points(j)) / 2, w = weights(i) * weights(j) / 4;
      const auto columns = [](double x, double y) {
        return std::array{Eigen::Vector3d(1, 0, y / 4), Eigen::Vector3d(y, 1, x / 4), Eigen::Vector3d(0, 0, 1)};
      };
      for (const double side : {0.0, 1.0}) {
        const auto at_x = columns(side, u), at_y = columns(u, side), at_z = columns(u, v);
        area += w * (at_x[1].cross(at_x[2]).norm() + at_y[0].cross(at_y[2]).norm() + at_z[0].cross(at_z[1]).norm());
      }
    }
  return area;
}

/// The unit cube under the map (x + y²/2, y, z + x y/4), whose Jacobian is 1, so its volume is 1.
HighOrderMesh bent_cube(Filling filling, int order) {
  HighOrderMesh mesh = testing::grid(filling, {2, 2, 1}, order);
  testing::move_nodes(mesh, [](testing::Place at) {
    const auto [x, y, z] = at;
    return testing::Place{x + y * y / 2, y, z + x * y / 4};
  });
  return mesh;
}

void expect_measured(Format format, const std::string& ending, const std::string& kind, Filling filling, int order) {
  const test::Folder folder;
  const std::string file = folder.file("cube" + ending);
  ASSERT_TRUE(formats::write_file(bent_cube(filling, order), format, file));
  std::ostringstream command;
  command << "/usr/bin/python3 '" << test::source_file("tests/core/hdf/check_hdf5.py") << "' " << kind << " '" << file
          << "' 1 " << std::setprecision(16) << area_of_bent_cube();
  EXPECT_EQ(std::system(command.str().c_str()), 0) << testing::name(filling) << " of order " << order;
}

TEST(HoprPeers, H5pyMeasuresTheVolumeAndTheSurface) {
  NEEDS_HDF5();
  if (!python_can("import h5py, numpy")) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  for (const Filling filling :
       {Filling::Hexahedra, Filling::Prisms, Filling::Pyramids, Filling::Tetrahedra, Filling::MixedSolid})
    for (const int order : {2, 3, 5}) expect_measured(Format::Hopr, ".h5", "hopr", filling, order);
}

TEST(PyfrPeers, H5pyMeasuresTheVolumeAndTheSurface) {
  NEEDS_HDF5();
  if (!python_can("import h5py, numpy")) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  // PyFR takes no pyramids whose base is bent.
  for (const Filling filling : {Filling::Hexahedra, Filling::Prisms, Filling::Tetrahedra})
    for (const int order : {2, 3, 5}) expect_measured(Format::Pyfr, ".pyfrm", "pyfr", filling, order);
}

// VTK 9.1 reads no quartic elements, swaps two edges of cubic hexahedra, and turns a face of cubic prisms.
TEST(CgnsPeers, VtkSeesTheMapAndMeasuresTheVolume) {
  NEEDS_HDF5();
  if (!python_can("import vtk; vtk.vtkCGNSReader")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  for (const Filling filling : {Filling::Hexahedra, Filling::Prisms, Filling::Tetrahedra})
    expect_measured(Format::Cgns, ".cgns", "cgns-vtk", filling, 2);
  expect_measured(Format::Cgns, ".cgns", "cgns-vtk", Filling::Tetrahedra, 3);
}

TEST(CgnsPeers, LibcgnsReadsElementsAndBoundaryConditions) {
  NEEDS_HDF5();
  if (!python_can("import ctypes, numpy; ctypes.CDLL(\"libcgns.so.3.4\")"))
    GTEST_SKIP() << "SKIPPED: libcgns is not installed (libcgns3.4)";
  for (const Filling filling :
       {Filling::Hexahedra, Filling::Prisms, Filling::Pyramids, Filling::Tetrahedra, Filling::MixedSolid})
    for (int order = 2; order <= 4; ++order) expect_measured(Format::Cgns, ".cgns", "cgns-library", filling, order);
}

}  // namespace
}  // namespace varimesh
