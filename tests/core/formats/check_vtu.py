#!/usr/bin/python3
"""check_vtu.py map FOLDER | outward FOLDER | drawn FOLDER | boundary FILE | pictures FILE | measure FILE MEASURE CELLS: checks how VTK reads VTU files. peers_test.cpp
runs it.

map: each file SHAPE_ORDER.vtu holds one cell, the reference cell under the map of one_cell() in samples.h. VTK evaluates
its cell at inner points and must find the map's values, the cell's numbers and its fields.
outward: each file SHAPE_ORDER.vtu holds one reference cell. VTK's volume, computed from tetrahedra and from the surface, must
be its own with the sign, and each of VTK's faces must point outwards. In 2-D the same goes for the area and the normal.
drawn: each file SHAPE_ORDER.vtu holds one cell and the elements of its boundary. VTK draws it with subdivisions, level by level.
boundary: the file's only field has the number of each cell from 0. It is active, and each face has the value of a cell that has all
its points.
pictures: the file's only field has the number of each cell. A picture with the elements of the boundary is the one without. This
needs Xvfb.
measure: the cells' areas or volumes must add up to MEASURE within 1.5 %, since VTK measures linear pieces.
"""
import contextlib
import ctypes
import glob
import os
import signal
import subprocess
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def read(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def mapped(dim, order, x, y, z):
    """The map of one_cell()."""
    if dim == 2:
        return x + 0.2 * y**order, y + 0.1 * x**order, 0.0
    return x + 0.2 * y**order, y + 0.1 * z**order, z + 0.15 * x**order


LINEAR_WEDGE, QUADRATIC_WEDGE = 13, 26


def reference(shape, order, cell_type, r, s, t):
    """VariMesh's reference coordinates from VTK's parametric ones, which go from 0 to 1."""
    x, y, z = 2 * r - 1, 2 * s - 1, 2 * t - 1
    if shape == "pyramid" and order > 1:  # a hexahedron collapsed towards the apex
        return x * (1 - t), y * (1 - t), z
    if cell_type in (LINEAR_WEDGE, QUADRATIC_WEDGE):  # mirror images of the Lagrange wedge
        return y, x, z
    return x, y, z


def check_map(path):
    shape, order = os.path.basename(path)[:-4].split("_")[:2]
    order = int(order)
    dim = 2 if shape in ("triangle", "quadrilateral") else 3
    grid = read(path)
    assert grid.GetNumberOfCells() == 1, path
    data = grid.GetCellData()
    assert data.GetArray("element").GetTuple1(0) == 7, path
    assert data.GetArray("physical").GetTuple1(0) == 5, path
    assert data.GetArray("order").GetTuple1(0) == order, path
    cell = grid.GetCell(0)
    if shape == "pyramid" and order == 1:
        return  # VTK's linear pyramid has another map inside; check_msh.py checks its corners
    if "serendipity" in path:
        assert cell.GetCellType() in (23, 25, QUADRATIC_WEDGE), path
    for point in ((0.2, 0.3, 0.1), (0.1, 0.15, 0.6), (0.5, 0.05, 0.3), (0.05, 0.55, 0.35)):
        value = [0.0] * 3
        cell.EvaluateLocation(vtk.reference(0), point, value, [0.0] * grid.GetNumberOfPoints())
        x, y, z = reference(shape, order, cell.GetCellType(), *point)
        wanted = mapped(dim, order, x, y, z)
        error = max(abs(a - b) for a, b in zip(value, wanted))
        assert error < 1e-9, "%s at %s: %s, not %s" % (path, point, value, wanted)


def corner_normal(points):
    """The normal at the first corner of a face, whose corners come first in its list; zero if a side has no length."""
    return np.cross(points[1] - points[0], points[2] - points[0])


def check_outward(path):
    measures = {"triangle": 2, "quadrilateral": 4, "tetrahedron": 4 / 3, "pyramid": 8 / 3, "prism": 4, "hexahedron": 8}
    shape = os.path.basename(path).split("_")[0]
    grid = read(path)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    cell = grid.GetCell(0)
    sizes = vtk.vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    flat = cell.GetCellDimension() == 2
    found = sizes.GetOutput().GetCellData().GetArray("Area" if flat else "Volume").GetTuple1(0)
    assert abs(found - measures[shape]) < 1e-12 * measures[shape], "%s: %g" % (path, found)
    if flat:
        assert corner_normal(points[[cell.GetPointId(k) for k in range(3)]])[2] > 0, path
        return
    for number in range(cell.GetNumberOfFaces()):
        face = cell.GetFace(number)
        corners = points[[face.GetPointId(k) for k in range(3)]]
        # A pyramid that is a hexahedron has one face without an area.
        assert np.dot(corner_normal(corners), corners[0] - points.mean(axis=0)) >= 0, "%s: face %d points inwards" % (path, number)
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputConnection(surface.GetOutputPort())
    triangles.Update()
    corners = vtk_to_numpy(triangles.GetOutput().GetPoints().GetData())[
        vtk_to_numpy(triangles.GetOutput().GetPolys().GetData()).reshape(-1, 4)[:, 1:]
    ].astype(float)
    enclosed = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert abs(enclosed - measures[shape]) < 1e-6 * measures[shape], "%s: the surface encloses %g" % (path, enclosed)


def check_drawn(path):
    """A viewer asks for more lines and triangles per curved cell. VTK 9.1 crashes at curved lines."""
    grid = read(path)
    before = 0
    for level in (1, 2, 3, 4):
        surface = vtk.vtkDataSetSurfaceFilter()
        surface.SetInputData(grid)
        surface.SetNonlinearSubdivisionLevel(level)
        surface.Update()
        drawn = surface.GetOutput().GetNumberOfPolys()
        straight = path.endswith("_1.vtu")
        assert drawn >= before if straight else drawn > before, "%s: %d polygons at level %d" % (path, drawn, level)
        before = drawn


def check_boundary(path):
    grid = read(path)
    data = grid.GetCellData()
    assert data.GetScalars() is not None and data.GetScalars().GetName() == "number", path
    dimensions, values = vtk_to_numpy(data.GetArray("dimension")), vtk_to_numpy(data.GetScalars())
    points = [set(grid.GetCell(i).GetPointId(k) for k in range(grid.GetCell(i).GetNumberOfPoints()))
              for i in range(grid.GetNumberOfCells())]  # fmt: skip
    faces = np.flatnonzero(dimensions < dimensions.max())
    assert len(faces) > 0, path
    for face in faces:
        assert points[face] <= points[int(values[face])], "%s: face %d has the value %g" % (path, face, values[face])


def check_pictures(path):
    """What a viewer shows at first: the surface, coloured by the active field, with more triangles per curved cell. Elements of
    the boundary lie on the cells. With them the picture must be the one without them."""
    grid = read(path)
    data = grid.GetCellData()
    dimensions = vtk_to_numpy(data.GetArray("dimension"))
    whole = dimensions == dimensions.max()
    values = data.GetScalars().GetRange()
    cells = vtk.vtkExtractCells()
    cells.SetInputData(grid)
    ids = vtk.vtkIdList()
    for i in np.flatnonzero(whole):
        ids.InsertNextId(int(i))
    cells.SetCellList(ids)
    cells.Update()
    spotted = vtk.vtkUnstructuredGrid()  # what a file shows whose boundary has no values
    spotted.DeepCopy(grid)
    vtk_to_numpy(spotted.GetCellData().GetScalars())[~whole] = np.nan
    for level in (1, 2, 3, 4):
        alone, drawn = picture(cells.GetOutput(), level, values), picture(grid, level, values)
        shown = (alone < 255).any(axis=2).sum()
        assert shown > 10_000, path
        share = lambda other: strange(alone, other).sum() / shown
        assert share(drawn) < 0.0005, "%s: %g of the picture differs at level %d" % (path, share(drawn), level)
        assert share(picture(spotted, level, values)) > 0.001, "%s: the comparison sees no speckles at level %d" % (path, level)


def strange(picture, other):
    """Which pixels of the other picture have a colour that no pixel of the picture has up to two pixels away: lines at the edge
    of a plane mesh are as wide as a pixel, and have pieces of their own where they are curved."""
    beside = [np.roll(picture, (i, j), (0, 1)) for i in range(-2, 3) for j in range(-2, 3)]
    return np.min([np.abs(other - one).max(axis=2) for one in beside], axis=0) > 8


def picture(grid, level, values):
    """The colours of 400 × 400 pixels, for this range of values; from aside if the cells are solid."""
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(level)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(surface.GetOutputPort())
    mapper.SetScalarRange(*values)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor)
    low, high = np.array(grid.GetBounds()).reshape(3, 2).T
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*(low + high) / 2)
    camera.SetPosition(*(low + high) / 2 + ((0.5, 0.7, 1) if high[2] > low[2] else (0, 0, 1)))
    renderer.ResetCamera(*grid.GetBounds())
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(400, 400)
    window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    image.Update()
    return vtk_to_numpy(image.GetOutput().GetPointData().GetScalars()).astype(int).reshape(400, 400, 3)


@contextlib.contextmanager
def screen():
    """A screen of its own, which VTK needs even for pictures that nobody sees."""
    theirs, ours = os.pipe()
    ends_with_us = lambda: ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
    with subprocess.Popen(["Xvfb", "-displayfd", str(ours), "-screen", "0", "640x480x24", "-nolisten", "tcp", "-noreset"], pass_fds=[ours],
                          preexec_fn=ends_with_us, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:  # fmt: skip
        os.close(ours)
        with os.fdopen(theirs) as number:
            os.environ["DISPLAY"] = ":" + number.readline().strip()
        try:
            yield
        finally:
            server.terminate()


def check_measure(path, measure, cells):
    grid = read(path)
    dimensions = vtk_to_numpy(grid.GetCellData().GetArray("dimension"))
    whole = dimensions == dimensions.max()  # the faces of the boundary come after the cells
    assert whole.sum() == cells and whole[:cells].all(), path
    sizes = vtk.vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    found = sizes.GetOutput().GetCellData()
    total = vtk_to_numpy(found.GetArray("Area" if dimensions.max() == 2 else "Volume"))[whole].sum()
    assert abs(total - measure) < 0.015 * measure, "%s: %g, not %g" % (path, total, measure)


if sys.argv[1] in ("map", "outward", "drawn"):
    files = sorted(glob.glob(os.path.join(sys.argv[2], "*.vtu")))
    assert files
    for file in files:
        {"map": check_map, "outward": check_outward, "drawn": check_drawn}[sys.argv[1]](file)
elif sys.argv[1] == "boundary":
    check_boundary(sys.argv[2])
elif sys.argv[1] == "pictures":
    with screen():
        check_pictures(sys.argv[2])
else:
    check_measure(sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))
