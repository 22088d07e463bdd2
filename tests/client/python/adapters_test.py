"""Meshes from meshio and from Gmsh's API: the real ones if they are installed, and objects with the same attributes."""
import sys
import types

import support
from support import CASES, MESH

support.need()
import numpy as np
import varimesh


def fake_meshio(mesh):
    cells = [types.SimpleNamespace(type={"line": "line", "triangle": "triangle"}[block.shape] + str(block.nodes.shape[1]),
                                   data=block.nodes.astype(np.uint64)) for block in mesh.blocks]
    return types.SimpleNamespace(points=mesh.nodes, cells=cells, field_data={"wing": np.array([4, 2])}, cell_data={
        "gmsh:physical": [np.full(len(block.nodes), 4) for block in mesh.blocks]})


# meshio's names of VTK's Lagrange cells, and of straight lines.
LAGRANGE = {3: "line", 68: "VTK_LAGRANGE_CURVE", 69: "VTK_LAGRANGE_TRIANGLE", 70: "VTK_LAGRANGE_QUADRILATERAL",
            71: "VTK_LAGRANGE_TETRAHEDRON", 72: "VTK_LAGRANGE_HEXAHEDRON", 73: "VTK_LAGRANGE_WEDGE"}


def read_with_vtk(file):
    """The grid of a VTU file, with pyvista's names."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    reader.Update()
    grid = reader.GetOutput()
    cells, data = grid.GetCells(), grid.GetCellData()
    return types.SimpleNamespace(
        points=vtk_to_numpy(grid.GetPoints().GetData()).copy(), celltypes=vtk_to_numpy(grid.GetCellTypesArray()).copy(),
        offset=vtk_to_numpy(cells.GetOffsetsArray()).copy(), cell_data={data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)).copy() for i in range(data.GetNumberOfArrays())},
        cell_connectivity=vtk_to_numpy(cells.GetConnectivityArray()).copy())


class Form(support.WithServer):
    def test_an_object_with_points_and_cells_is_taken_as_a_mesh(self):
        start = self.client.optimise(MESH, max_iterations=0).mesh
        like = fake_meshio(start)
        mesh = varimesh.from_meshio(like)
        self.assertEqual((mesh.groups, {block.physical for block in mesh.blocks}), ({(2, 4): "wing"}, {(4,)}))
        result = self.client.optimise(like)
        np.testing.assert_array_equal(result.nodes, self.client.optimise(start).nodes)

    def test_cells_in_another_node_order_are_converted_or_refused(self):
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
        edges = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))  # VTK's order; in Gmsh's the last two are swapped
        points = np.vstack([corners, *(corners[list(edge)].mean(axis=0) for edge in edges)])
        mesh = types.SimpleNamespace(points=points, cells=[("tetra10", [list(range(10))])])
        self.assertEqual(varimesh.from_meshio(mesh).blocks[0].nodes[0].tolist(), [0, 1, 2, 3, 4, 5, 6, 7, 9, 8])
        mesh.cells = [("polyhedron4", [[0, 1, 2, 3]])]
        with self.assertRaises(varimesh.BadMesh):
            varimesh.from_meshio(mesh)
        with self.assertRaises(varimesh.BadMesh):
            self.client.optimise(42)

    def test_a_grid_of_vtk_cells_is_taken_as_a_mesh(self):
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
        grid = types.SimpleNamespace(points=points, celltypes=np.array([10, 10]), offset=np.array([0, 4, 8]),
                                     cell_connectivity=np.array([0, 1, 2, 3, 1, 4, 2, 3]),
                                     cell_data={"gmsh:physical": np.array([3, 4])})
        mesh = varimesh.from_pyvista(grid)
        self.assertEqual([(block.shape, block.physical, block.nodes.tolist()) for block in mesh.blocks],
                         [("tetrahedron", (3,), [[0, 1, 2, 3]]), ("tetrahedron", (4,), [[1, 4, 2, 3]])])
        self.assertEqual(self.client.quality(grid).number.tolist(), [0, 1])
        prism = types.SimpleNamespace(points=np.vstack([points, [[1, 0, 1]]]), celltypes=np.array([13]),
                                      offset=np.array([0, 6]), cell_connectivity=np.arange(6))
        self.assertEqual(varimesh.from_pyvista(prism).blocks[0].nodes.tolist(), [[0, 2, 1, 3, 5, 4]])
        grid.celltypes = np.array([7, 7])
        with self.assertRaisesRegex(varimesh.BadMesh, "type 7"):
            self.client.quality(grid)

    def test_serendipity_cells_of_meshio_become_complete_ones(self):
        """A quadrilateral with eight nodes on the unit square; the ninth is in the middle."""
        points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]]
        like = types.SimpleNamespace(points=np.array(points, dtype=float), cells=[("quad8", [list(range(8))])])
        mesh = self.client._as_mesh(like)
        self.assertEqual(mesh.columns, 2)
        np.testing.assert_allclose(mesh.nodes[mesh.cells["quadrilateral"][0][8]], [0.5, 0.5, 0], atol=1e-15)
        result = self.client.optimise(like)
        self.assertEqual(result.nodes.shape, (9, 2))
        self.assertTrue(result.valid)
        # The same as arrays.
        result = self.client.optimise((points, {"quad": [list(range(8))]}))
        self.assertEqual(result.nodes.shape, (9, 2))
        np.testing.assert_allclose(result.nodes[8], [0.5, 0.5], atol=1e-15)

    def test_arrays_may_have_cells_of_several_orders(self):
        """A triangle of order 1 beside one of order 2, whose nodes keep their places in the arrays."""
        points = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
        cells = [("triangle6", [[0, 1, 2, 4, 5, 6]]), varimesh.Block("triangle", np.array([[1, 3, 2]], np.int32), 5, (7, 8))]
        mesh = self.client._as_mesh((points, cells))
        self.assertEqual((mesh.order, len(mesh.nodes), mesh.columns), (2, 9, 2))
        np.testing.assert_array_equal(mesh.nodes[:7, :2], points)
        self.assertEqual([block.nodes.tolist()[0][:3] for block in mesh.blocks], [[0, 1, 2], [1, 3, 2]])
        self.assertEqual((mesh.blocks[1].entity, mesh.blocks[1].physical), (5, (7, 8)))
        result = self.client.optimise((points, cells))
        self.assertTrue(result.valid)
        self.assertEqual(result.nodes.shape, (9, 2))
        with self.assertRaisesRegex(varimesh.BadMesh, "several orders"):
            varimesh.Mesh.from_arrays(points, cells)


class Vtk(support.WithServer):
    """Grids as VTK has them in memory, for which pyvista is only a wrapper."""

    def vtk_grid(self, case):
        """A case as VTK has it in memory, through a VTU file of the command."""
        file = self.folder / f"{case}.vtu"
        self.client.quality(CASES / case, file)
        return read_with_vtk(file)

    def test_lagrange_cells_are_taken_as_the_server_reads_them(self):
        """Cells of VTK give the mesh of the file from which VTK has them."""
        for case in ("nine_triangles.msh", "annulus_p3.msh", "sphere_p3.msh", "thick_layer_p3.msh"):
            with self.subTest(case):
                grid = self.vtk_grid(case)
                of_file = self.client.quality(CASES / case)
                # The bytes of VTU files round nothing, so the figures are the same ones.
                of_grid = self.client.quality(grid)
                self.assertEqual(of_grid.min_scaled_jacobian, of_file.min_scaled_jacobian)
                self.assertEqual(of_grid.certified.valid, of_file.certified.valid)
                mesh = self.client._as_mesh(grid)
                np.testing.assert_array_equal(mesh.nodes, grid.points)
                blocks = [(LAGRANGE[kind], grid.cell_connectivity[first:last].reshape(1, -1))
                          for kind, first, last in zip(grid.celltypes, grid.offset[:-1], grid.offset[1:])]
                like = types.SimpleNamespace(points=grid.points, cells=blocks)
                self.assertEqual(self.client.quality(like).min_scaled_jacobian, of_file.min_scaled_jacobian)


class Pyvista(support.WithServer):
    def test_goes_in_and_out(self):
        import pyvista

        result = self.client.optimise(CASES / "cylinder_p2.msh", max_iterations=2)
        grid = result.to_pyvista()
        self.assertIsInstance(grid, pyvista.UnstructuredGrid)
        self.assertIn("scaled_jacobian", grid.cell_data)
        again = varimesh.from_pyvista(grid)
        np.testing.assert_allclose(again.nodes, result.nodes, rtol=0, atol=1e-12)
        self.assertEqual(self.client.quality(grid).certified, result.after.certified)


class Meshio(support.WithServer):
    def test_goes_out_and_in_again(self):
        for case in ("nine_triangles.msh", "cylinder_p2.msh", "sphere_p3.msh"):
            result = self.client.optimise(CASES / case, max_iterations=1)
            again = varimesh.from_meshio(result.to_meshio())
            np.testing.assert_array_equal(again.nodes, result.mesh.nodes)
            self.assertEqual(again.groups, result.mesh.groups)
            self.assertEqual([(block.shape, block.nodes.tolist()) for block in again.blocks],
                             [(block.shape, block.nodes.tolist()) for block in result.mesh.blocks], case)

    def test_curved_lines_of_a_vtu_file_are_whole(self):
        """They are several straight cells in the file."""
        sys.path.insert(0, str(support.SOURCE / "tests" / "core" / "formats" / "vtu"))
        import meshio_vtu

        for case in ("nine_triangles.msh", "annulus_p3.msh"):
            file = self.folder / f"{case}.vtu"
            self.client.quality(CASES / case, file)
            of_file, of_meshio = self.client.optimise(CASES / case, max_iterations=0).mesh, self.client._as_mesh(meshio_vtu.read(file))
            np.testing.assert_array_equal(of_meshio.nodes, meshio_vtu.read(file).points)
            lines = [[len(block.nodes) for block in mesh.blocks if block.shape == "line"] for mesh in (of_file, of_meshio)]
            self.assertEqual(sum(lines[0]), sum(lines[1]), case)

    def test_gives_the_same_result_as_the_file(self):
        import meshio

        for case in ("nine_triangles.msh", "cylinder_p2.msh"):
            mesh = meshio.read(CASES / case)
            of_file = self.client.optimise(CASES / case, max_iterations=2)
            result = self.client.optimise(mesh, max_iterations=2)
            np.testing.assert_allclose(result.nodes, of_file.nodes, rtol=0, atol=1e-9)
            self.assertEqual(result.after.certified, of_file.after.certified)
            self.assertEqual(varimesh.from_meshio(mesh).groups, of_file.mesh.groups)

    def test_reorders_nodes_as_meshio_does_when_it_writes(self):
        from meshio.gmsh import common
        from varimesh import adapters

        for name, order in adapters._FROM_MESHIO.items():
            row = np.arange(len(order))[None, :]
            self.assertEqual(common._meshio_to_gmsh_order(name, row)[0].tolist(), order, name)


class Gmsh(support.WithServer):
    def test_a_model_is_optimised_in_memory(self):
        import gmsh

        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        self.addCleanup(gmsh.finalize)
        gmsh.open(str(CASES / "annulus_p3.msh"))
        mesh = varimesh.from_gmsh(gmsh)
        of_file = self.client.optimise(CASES / "annulus_p3.msh", max_iterations=2, arrays=True)
        self.assertEqual(len(mesh.nodes), len(of_file.nodes))
        result = self.client.optimise(gmsh, max_iterations=2)
        self.assertEqual(result.after.certified.valid, of_file.after.certified.valid)
        np.testing.assert_array_equal(result.mesh.node_tags, mesh.node_tags)
        varimesh.update_gmsh(gmsh, result.mesh)
        np.testing.assert_allclose(varimesh.from_gmsh(gmsh).nodes, result.nodes, rtol=0, atol=1e-15)
        with self.assertRaises(varimesh.BadMesh):
            varimesh.update_gmsh(gmsh, of_file.mesh)


if __name__ == "__main__":
    support.main(Vtk={"python3-vtk9": "vtkmodules"}, Meshio={"python3-meshio": "meshio"}, Pyvista={"pyvista (from PyPI)": "pyvista"}, Gmsh={"python3-gmsh": "gmsh"})
