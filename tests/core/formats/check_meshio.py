#!/usr/bin/python3
"""check_meshio.py FOLDER: checks that meshio, VTK and Gmsh see the same mesh in VTU files. peers_test.cpp runs it.

Each file SHAPE_ORDER.vtu holds one cell in the group 5 and its faces in the group 9, whose name is `the <wall> & door`.
meshio and VTK must find the same points and the same nodes of each cell, and both groups. Files of order 1 are then written
by meshio as MSH, and Gmsh must find the points and the groups.
"""
import glob
import os
import sys

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "vtu"))
import meshio_vtu  # noqa: E402

NAME = "the <wall> & door"


def check_vtk(path, mesh):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), mesh.points)
    assert grid.GetNumberOfCells() == sum(len(block.data) for block in mesh.cells), path
    groups = vtk_to_numpy(grid.GetCellData().GetArray("gmsh:physical"))
    np.testing.assert_array_equal(groups, np.concatenate(mesh.cell_data["gmsh:physical"]).ravel())
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetFieldData().GetArray(NAME)), mesh.field_data[NAME])
    values = vtk_to_numpy(grid.GetCellData().GetArray("value"))
    assert (values == values[0]).all(), path  # the faces have the value of their cell


def check_gmsh(path, mesh, gmsh):
    mesh.cell_data = {name: mesh.cell_data[name] for name in ("gmsh:physical", "gmsh:geometrical")}
    name = path + ".msh"
    meshio.write(name, mesh, file_format="gmsh22", binary=False)
    gmsh.clear()
    try:
        gmsh.open(name)
    except Exception as error:
        print(path, error, open(name).read())
        raise
    tags, points, _ = gmsh.model.mesh.getNodes()
    np.testing.assert_allclose(np.array(points).reshape(-1, 3)[np.argsort(tags)], mesh.points, rtol=0, atol=1e-15)
    dimension = gmsh.model.getDimension()
    assert gmsh.model.getPhysicalGroups() == [(dimension - 1, 9), (dimension, 5)], gmsh.model.getPhysicalGroups()
    assert gmsh.model.getPhysicalName(dimension - 1, 9) == NAME, path


def main(folder):
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    files = sorted(glob.glob(os.path.join(folder, "*.vtu")))
    assert files
    for path in files:
        shape, order = os.path.basename(path)[:-4].split("_")
        mesh = meshio_vtu.read(path)
        dimension = 2 if shape in ("triangle", "quadrilateral") else 3
        groups = np.concatenate(mesh.cell_data["gmsh:physical"]).ravel().tolist()
        assert groups == [5] + [9] * (len(groups) - 1) and len(groups) > 3, groups
        assert mesh.field_data[NAME].tolist() == [9, dimension - 1], mesh.field_data
        check_vtk(path, mesh)
        if order == "1":
            check_gmsh(path, mesh, gmsh)


main(sys.argv[1])
