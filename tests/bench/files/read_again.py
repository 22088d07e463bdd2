"""Reads meshes with the programs whose formats they have. Each reader gives the number of cells and, if the program
measures cells, what these measure together; otherwise None."""
import sys
from pathlib import Path

import numpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "core" / "formats" / "vtu"))


def with_gmsh(path):
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        model = gmsh.model.mesh
        dimension = max(d for d in range(4) if len(model.getElements(d)[0]))
        cells, measure = 0, 0.0
        for kind, elements in zip(*model.getElements(dimension)[:2]):
            cells += len(elements)
            # More points take Gmsh minutes at order 9.
            points, weights = model.getIntegrationPoints(kind, f"Gauss{min(8, 3 * model.getElementProperties(kind)[2])}")
            determinants = numpy.reshape(model.getJacobians(kind, points)[1], (len(elements), -1))
            measure += float((determinants @ weights).sum())
        return cells, measure
    finally:
        gmsh.finalize()


def with_vtk(path):
    import vtk

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    dimensions = [grid.GetCell(i).GetCellDimension() for i in range(grid.GetNumberOfCells())]
    return dimensions.count(max(dimensions)), None


def with_meshio(path):
    import meshio
    import meshio_vtu

    blocks = (meshio_vtu if path.suffix == ".vtu" else meshio).read(path).cells
    dimension = max(block.dim for block in blocks)
    return sum(len(block.data) for block in blocks if block.dim == dimension), None


def with_h5py(path):
    import h5py

    with h5py.File(path, "r") as file:
        if "ElemInfo" in file:  # HOPR: types from 100 on are solids
            return int((file["ElemInfo"][:, 0] >= 100).sum()), None
        if "spt_tri_p0" in file or any(name.startswith("spt_") for name in file):  # PyFR
            return sum(file[name].shape[1] for name in file if name.startswith("spt_")), None
        cells = {}  # CGNS: ranges of sections, by the type of their elements

        def visit(name, group):
            if isinstance(group, h5py.Group) and group.attrs.get("label", b"").startswith(b"Elements_t"):
                kind, first = int(group[" data"][0]), group["ElementRange"][" data"]
                cells[kind] = cells.get(kind, 0) + int(first[1] - first[0] + 1)

        file.visititems(visit)
        # By CGNS' numbers of types: solids, then faces.
        solids = sum(n for kind, n in cells.items() if kind in (10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 21) or 33 <= kind)
        faces = sum(n for kind, n in cells.items() if 5 <= kind <= 9 or 26 <= kind <= 32)
        return solids or faces, None


def readers(path):
    return {".msh": [("Gmsh", with_gmsh)], ".vtu": [("VTK", with_vtk), ("meshio", with_meshio)],
            ".su2": [("meshio", with_meshio)], ".h5": [("h5py", with_h5py)],
            ".cgns": [("h5py", with_h5py)], ".pyfrm": [("h5py", with_h5py)]}.get(path.suffix, [])  # fmt: skip
