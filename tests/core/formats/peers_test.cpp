// Gmsh and VTK open the written files and see the same mesh. Both run as separate programs. If Debian's python3-gmsh or
// python3-vtk9 is missing, the tests say so and are skipped. Debian has no MFEM, so a reader of our own in Python,
// which shares nothing with VariMesh's, reads its files.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <iomanip>
#include <sstream>

#include "core/formats/common/reading_notes.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

bool has_module(const std::string& module) {
  return std::system(("/usr/bin/python3 -c 'import " + module + "' >/dev/null 2>&1").c_str()) == 0;
}

int run_script(const std::string& name, const std::string& arguments) {
  const std::string script = test::source_file("tests/core/formats/" + name);
  return std::system(("/usr/bin/python3 '" + script + "' " + arguments).c_str());
}

const Shape kCells[] = {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                        Shape::Pyramid,  Shape::Prism,         Shape::Hexahedron};

// Single cells under a known map of their order. VTK evaluates them at inner points. Only the right permutation of the
// nodes gives the map's values.
TEST(Vtu, VtkSeesTheMapThatWasWritten) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  const test::Folder folder;
  for (Shape shape : kCells)
    for (int order = 1; order <= 10; ++order) {
      const double value = order;
      const formats::CellField field{"order", {&value, 1}};
      const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order) + ".vtu";
      ASSERT_TRUE(formats::write_file(test::one_cell(shape, order), Format::Vtu, folder.file(name), {&field, 1}));
    }
  // The map of order 2 is in the spaces of the serendipity cells too. VTK's quadratic pyramid has a space of its own
  // inside, which does not hold all polynomials of degree 2.
  for (Shape shape : {Shape::Quadrilateral, Shape::Hexahedron, Shape::Prism}) {
    HighOrderMesh mesh = test::one_cell(shape, 2);
    formats::remember_serendipity(mesh, {shape});
    const double value = 2;
    const formats::CellField field{"order", {&value, 1}};
    const std::string name = std::string(reference::info(shape).name) + "_2_serendipity.vtu";
    ASSERT_TRUE(formats::write_file(mesh, Format::Vtu, folder.file(name), {&field, 1}));
  }
  EXPECT_EQ(run_script("check_vtu.py", "map '" + folder.path() + "'"), 0);
}

// Reference cells. In VTK's eyes they have their volumes, with the sign, and their faces point outwards.
TEST(Vtu, VtkFindsPositiveVolumesAndOutwardFaces) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  const test::Folder folder;
  for (Shape shape : kCells)
    for (int order = 1; order <= 10; ++order) {
      HighOrderMesh mesh = test::one_cell(shape, order);
      const auto& at = reference::nodes(shape, order, reference::NodeSet::Equispaced, mesh.dimension);
      for (Eigen::Index i = 0; i < at.rows(); ++i)
        for (Eigen::Index k = 0; k < at.cols(); ++k) mesh.coordinates[3 * std::size_t(i) + std::size_t(k)] = at(i, k);
      const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order) + ".vtu";
      ASSERT_TRUE(formats::write_file(mesh, Format::Vtu, folder.file(name)));
    }
  EXPECT_EQ(run_script("check_vtu.py", "outward '" + folder.path() + "'"), 0);
}

// Faces without values would show as speckles where they lie on cells that have one.
TEST(Vtu, BoundaryFacesHaveTheValuesOfTheirCells) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  const test::Folder folder;
  for (const testing::Filling filling : {testing::Filling::MixedPlane, testing::Filling::MixedSolid})
    for (const int order : {1, 3}) {
      const HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order);
      ASSERT_GT(mesh.element_count(mesh.dimension - 1), 0U);
      std::vector<double> values(mesh.element_count(mesh.dimension));
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = double(i);
      const formats::CellField field{"number", values};
      const std::string file = folder.file("grid.vtu");
      ASSERT_TRUE(formats::write_file(mesh, Format::Vtu, file, {&field, 1}));
      EXPECT_EQ(run_script("check_vtu.py", "boundary '" + file + "'"), 0) << testing::name(filling);
    }
}

// Boundary elements lie on the cells, so they would show where they had other colours.
TEST(Vtu, PicturesHaveNoSpeckles) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  if (std::system("command -v Xvfb >/dev/null") != 0) GTEST_SKIP() << "SKIPPED: there is no screen to draw on (xvfb)";
  const test::Folder folder;
  for (const char* name : {"sphere_p3", "demo", "annulus_p3", "circle_p5"}) {
    const auto mesh = formats::read_file(test::source_file(std::string("tests/cases/") + name + ".msh"));
    ASSERT_TRUE(mesh) << mesh.error().sentence;
    std::vector<double> values(mesh->mesh.element_count(mesh->mesh.dimension));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = double(i);
    const formats::CellField field{"number", values};
    const std::string file = folder.file(std::string(name) + ".vtu");
    ASSERT_TRUE(formats::write_file(mesh->mesh, Format::Vtu, file, {&field, 1}));
    EXPECT_EQ(run_script("check_vtu.py", "pictures '" + file + "'"), 0) << name;
  }
}

TEST(Vtu, VtkMeasuresTheWholeMesh) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  const test::Folder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"sphere_p3", "7.4764"}, {"circle_p5", "3.80365"}, {"annulus_p3", "11.781"}, {"cylinder_p2", "3.6"}};
  for (const auto& [name, measure] : cases) {
    const auto mesh = formats::read_file(test::source_file(std::string("tests/cases/") + name + ".msh"));
    ASSERT_TRUE(mesh) << mesh.error().sentence;
    const std::string file = folder.file(std::string(name) + ".vtu");
    ASSERT_TRUE(formats::write_file(mesh->mesh, Format::Vtu, file));
    EXPECT_EQ(run_script("check_vtu.py", "measure '" + file + "' " + measure + " " +
                                             std::to_string(mesh->mesh.element_count(mesh->mesh.dimension))),
              0);
  }
}

/// One cell in its group, with its faces in the group 9.
HighOrderMesh cell_with_faces(Shape shape, int order) {
  HighOrderMesh mesh = test::one_cell(shape, order);
  const auto& info = reference::info(shape);
  for (int f = 0; f < int(info.facets.size()); ++f) {
    ElementBlock face;
    face.shape = info.facets[std::size_t(f)].shape;
    face.order = order;
    face.entity = f + 1;
    face.physical = {9};
    face.numbers = {100 + f};
    for (int local : reference::facet_nodes(shape, order, f))
      face.nodes.push_back(mesh.blocks.back().nodes[std::size_t(local)]);
    mesh.blocks.insert(mesh.blocks.begin(), face);
  }
  mesh.physical_groups = {{mesh.dimension - 1, 9, "the <wall> & door"}, {mesh.dimension, 5, "inside"}};
  return mesh;
}

TEST(Vtu, VtkDrawsEveryShapeWithSubdivisions) {
  if (!has_module("vtk")) GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  const test::Folder folder;
  for (Shape shape : kCells)
    for (int order = 1; order <= 10; ++order) {
      const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order) + ".vtu";
      ASSERT_TRUE(formats::write_file(cell_with_faces(shape, order), Format::Vtu, folder.file(name)));
    }
  EXPECT_EQ(run_script("check_vtu.py", "drawn '" + folder.path() + "'"), 0);
}

TEST(Vtu, MeshioVtkAndGmshAgree) {
  for (const char* module : {"meshio", "vtk", "gmsh"})
    if (!has_module(module)) GTEST_SKIP() << "SKIPPED: " << module << " is not installed";
  const test::Folder folder;
  for (Shape shape : kCells)
    for (int order = 1; order <= 4; ++order) {
      const double value = order;
      const formats::CellField field{"value", {&value, 1}};
      const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order) + ".vtu";
      ASSERT_TRUE(formats::write_file(cell_with_faces(shape, order), Format::Vtu, folder.file(name), {&field, 1}));
    }
  EXPECT_EQ(run_script("check_meshio.py", "'" + folder.path() + "'"), 0);
}

TEST(Gmsh, OpensEveryShapeOrderAndVersion) {
  if (!has_module("gmsh")) GTEST_SKIP() << "SKIPPED: Gmsh is not installed (python3-gmsh)";
  const test::Folder folder;
  for (Shape shape : kCells)
    for (int order = 1; order <= (shape <= Shape::Tetrahedron ? 10 : 9); ++order)
      for (const formats::FormatInfo& format : formats::all()) {
        if (format.extension != ".msh") continue;
        const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order) + "_" +
                                 std::string(format.name) + ".msh";
        ASSERT_TRUE(formats::write_file(test::one_cell(shape, order), format.format, folder.file(name)));
      }
  EXPECT_EQ(run_script("check_msh.py", "'" + folder.path() + "'"), 0);
}

/// The area of the six sides of the unit cube under the map of the next test, by Gauss's rule with 40 points per
/// direction on |∂X/∂u × ∂X/∂v|.
double area_of_bent_cube() {
  const auto [points, weights] = reference::gauss_jacobi(40, 0, 0);
  double area = 0;
  for (Eigen::Index i = 0; i < points.size(); ++i)
    for (Eigen::Index j = 0; j < points.size(); ++j) {
      const double u = (1 + points(i)) / 2, v = (1 + points(j)) / 2, w = weights(i) * weights(j) / 4;
      // Derivatives of the map by x, y and z at (x, y): they do not depend on z.
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

// The unit cube under the map (x + y²/2, y, z + x y/4), whose Jacobian is 1, so its volume is 1. A reader of our own
// measures what is written in a format for which Debian has no reader.
void expect_measured(Format format, const char* ending, const std::string& script, bool as_text = false) {
  if (!has_module("numpy")) GTEST_SKIP() << "SKIPPED: NumPy is not installed (python3-numpy)";
  const test::Folder folder;
  using testing::Filling;
  for (const Filling filling :
       {Filling::Hexahedra, Filling::Prisms, Filling::Pyramids, Filling::Tetrahedra, Filling::MixedSolid})
    for (int order = 2; order <= 5; ++order) {
      HighOrderMesh mesh = testing::grid(filling, {2, 2, 1}, order);
      testing::move_nodes(mesh, [](testing::Place at) {
        const auto [x, y, z] = at;
        return testing::Place{x + y * y / 2, y, z + x * y / 4};
      });
      if (as_text) mesh.foreign.push_back({"text", "", "nektar"});
      const std::string file = folder.file(std::string("cube") + ending);
      ASSERT_TRUE(formats::write_file(mesh, format, file));
      std::ostringstream wanted;
      wanted << std::setprecision(16) << "'" << file << "' 1 " << area_of_bent_cube();
      EXPECT_EQ(run_script(script, wanted.str()), 0) << testing::name(filling) << " of order " << order;
    }
}

TEST(Mfem, AReaderOfItsOwnMeasuresTheVolumeAndTheSurface) { expect_measured(Format::Mfem, ".mesh", "check_mfem.py"); }

TEST(Nektar, AReaderOfItsOwnMeasuresTheVolumeAndTheSurface) {
  expect_measured(Format::Nektar, ".xml", "nektar/check_nektar.py");
  expect_measured(Format::Nektar, ".xml", "nektar/check_nektar.py", true);
}

}  // namespace
}  // namespace varimesh
