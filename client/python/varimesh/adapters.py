"""Conversion of meshes from and to meshio, pyvista and Gmsh's API. Any object with their attributes works."""
from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from .errors import BadMesh
from .mesh import Block, Mesh, indices, only_server_reads, shape_name, take_arrays, to_msh

#: Reads the bytes of a VTU or MSH file.
ReadVtu: TypeAlias = Callable[[bytes], Mesh]

# Cells whose nodes meshio has in VTK's order, which differs from Gmsh's. Gmsh's node i is meshio's node order[i].
_FROM_MESHIO = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron27": [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26],
}


def from_meshio(mesh: Any, read_vtu: ReadVtu | None = None) -> Mesh:
    """The Mesh of a meshio.Mesh: its `points` and `cells`, and any groups in `cell_data` and `field_data`. A server reads
    Lagrange and serendipity cells: that of varimesh.optimise(), unless `read_vtu` does it."""
    data = getattr(mesh, "cell_data", {}) or {}
    pairs = [(cells.type, cells.data) if hasattr(cells, "type") else cells for cells in mesh.cells]
    arrays = [(name, indices(name, nodes)) for name, nodes in pairs]
    if any(_only_in_files(name) for name, _ in arrays):
        read = _with_columns(read_vtu or _of_shared_client, np.asarray(mesh.points).shape[1])
        return read(VtkGrid.of_meshio(arrays, mesh).to_vtu())
    blocks: list[Block] = []
    for i, (name, array) in enumerate(arrays):
        if name in _FROM_MESHIO:
            array = array[:, _FROM_MESHIO[name]]
        entities, groups = (_column(data, key, i, len(array)) for key in ("gmsh:geometrical", "gmsh:physical"))
        blocks += _by_entity(shape_name(name), array, entities, groups)
    names = {(int(value[1]), int(value[0])): name for name, value in (getattr(mesh, "field_data", {}) or {}).items()}
    return Mesh.from_arrays(mesh.points, blocks, names)


def _of_shared_client(file: bytes) -> Mesh:
    from .shared import shared_client  # which builds on this module

    return shared_client()._read_vtu(file)


def _with_columns(read: ReadVtu, columns: int) -> ReadVtu:
    """Reads a mesh, and notes how many coordinates the caller gave for each node."""
    return lambda file: replace(read(file), columns=columns)


def _column(data: Any, key: str, block: int, count: int) -> NDArray[np.int64]:
    return np.asarray(data[key][block], dtype=np.int64) if key in data else np.zeros(count, dtype=np.int64)


def _by_entity(shape: str, nodes: NDArray[np.int32], entities: NDArray[np.int64],
               groups: NDArray[np.int64]) -> Iterator[Block]:  # fmt: skip
    """Splits elements into blocks: consecutive elements on one entity and in one group."""
    changes = np.flatnonzero((np.diff(entities) != 0) | (np.diff(groups) != 0)) + 1
    for piece in np.split(np.arange(len(nodes)), changes):
        if len(piece):
            entity, group = int(entities[piece[0]]), int(groups[piece[0]])
            yield Block(shape, nodes[piece], entity, (group,) if group > 0 else ())


def to_meshio(mesh: Mesh) -> Any:
    """The meshio.Mesh of a Mesh, with its entities, its groups and their names. Needs meshio."""
    import meshio

    names = {"quadrilateral": "quad", "tetrahedron": "tetra", "prism": "wedge", "point": "vertex"}
    # meshio's names for cells of order 1 have no number.
    corners = {"point": 1, "line": 2, "triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "pyramid": 5, "prism": 6,
               "hexahedron": 8}  # fmt: skip
    cells: list[tuple[str, NDArray[np.int32]]] = []
    for block in mesh.blocks:
        count = block.nodes.shape[1]
        name = names.get(block.shape, block.shape) + ("" if count == corners[block.shape] else str(count))
        order = _FROM_MESHIO.get(name)
        cells.append((name, block.nodes if order is None else block.nodes[:, np.argsort(order)]))
    data = {"gmsh:physical": [np.full(len(block.nodes), block.physical[0] if block.physical else 0) for block in mesh.blocks],
            "gmsh:geometrical": [np.full(len(block.nodes), block.entity) for block in mesh.blocks]}  # fmt: skip
    fields = {name: np.array([tag, dimension]) for (dimension, tag), name in mesh.groups.items()}
    return meshio.Mesh(mesh.nodes[:, : mesh.columns], cells, cell_data=data, field_data=fields)


# VTK's cell types of order 1 and 2 that need no server, as meshio names them. Lagrange cells of order 2 have the node order
# of the others, except hexahedra and prisms.
_VTK_TYPES = {1: "vertex", 3: "line", 5: "triangle", 9: "quad", 10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid",
              21: "line3", 22: "triangle6", 24: "tetra10", 28: "quad9", 29: "hexahedron27"}  # fmt: skip
_VTK_LAGRANGE = {68: "line", 69: "triangle", 70: "quad", 71: "tetra"}
_SECOND_ORDER = {"line": 3, "triangle": 6, "quad": 9, "tetra": 10}


def _vtk_name(kind: int, nodes: int) -> str | None:
    """meshio's name for a VTK type; None: only a server reads such cells."""
    shape = _VTK_LAGRANGE.get(kind, "")
    if shape and _SECOND_ORDER[shape] == nodes:
        return f"{shape}{nodes}"
    return _VTK_TYPES.get(kind)


def from_pyvista(grid: Any, read_vtu: ReadVtu | None = None) -> Mesh:
    """The Mesh of a pyvista.UnstructuredGrid, with the cell array "gmsh:physical" if there is one. A server reads
    serendipity cells, cells of order 3 and above, and hexahedra and prisms of order 2: that of varimesh.optimise(), unless
    `read_vtu` does it."""
    kinds, offsets = np.asarray(grid.celltypes), np.asarray(grid.offset)
    connectivity = np.asarray(grid.cell_connectivity)
    counts = np.diff(offsets)
    pairs: set[Any] = set(zip(kinds.tolist(), counts.tolist()))
    if any(_vtk_name(kind, count) is None for kind, count in pairs):
        return (read_vtu or _of_shared_client)(VtkGrid.of_pyvista(grid).to_vtu())
    data = getattr(grid, "cell_data", {})
    groups = np.asarray(data["gmsh:physical"] if "gmsh:physical" in data else np.zeros(len(kinds)), dtype=np.int64)
    blocks: list[Block] = []
    changes = np.flatnonzero((np.diff(kinds) != 0) | (np.diff(counts) != 0) | (np.diff(groups) != 0)) + 1
    for piece in np.split(np.arange(len(kinds)), changes):
        if not len(piece):
            continue
        first, count, group = piece[0], int(counts[piece[0]]), int(groups[piece[0]])
        name = _vtk_name(int(kinds[first]), count)
        assert name is not None
        array: NDArray[Any] = connectivity[offsets[first] : offsets[piece[-1] + 1]].reshape(-1, count)
        if name in _FROM_MESHIO:
            array = array[:, _FROM_MESHIO[name]]
        if name == "wedge":  # meshio's wedge is numbered like Gmsh's, VTK's is its mirror image
            array = array[:, [0, 2, 1, 3, 5, 4]]
        blocks.append(Block(shape_name(name), array.astype(np.int32), 1, (group,) if group > 0 else ()))
    return Mesh.from_arrays(grid.points, blocks)


def from_gmsh(gmsh: Any) -> Mesh:
    """The Mesh of the current model of the module `gmsh`, with its entities and physical groups."""
    api = gmsh.model.mesh
    tags, xyz, _ = api.getNodes()
    tags = np.asarray(tags, dtype=np.int64)
    if len(tags) == 0:
        raise BadMesh("The gmsh model has no mesh; call gmsh.model.mesh.generate() first.")
    place = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    blocks: list[Block] = []
    for dimension, entity in gmsh.model.getEntities():
        groups = tuple(int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dimension, entity))
        kinds, _, nodes = api.getElements(dimension, entity)
        for kind, numbers in zip(kinds, nodes):
            name, _, _, count = api.getElementProperties(kind)[:4]
            array = place[np.asarray(numbers, dtype=np.int64)].reshape(-1, count).astype(np.int32)
            blocks.append(Block(shape_name(name.split()[0]), array, entity, groups))
    names = {(dim, tag): gmsh.model.getPhysicalName(dim, tag) for dim, tag in gmsh.model.getPhysicalGroups()}
    mesh = Mesh.from_arrays(np.asarray(xyz, dtype=np.float64).reshape(-1, 3), blocks, {k: v for k, v in names.items() if v})
    mesh.node_tags = tags
    return mesh


def update_gmsh(gmsh: Any, mesh: Mesh) -> None:
    """Moves the nodes of gmsh's current model to their positions in `mesh`. The mesh must come from from_gmsh() of that
    model."""
    if mesh.node_tags is None or len(mesh.node_tags) != len(mesh.nodes):
        raise BadMesh("The mesh does not have the nodes of a gmsh model: it comes from elsewhere, or has another order.")
    tags: Any = mesh.node_tags.tolist()
    places: Any = mesh.nodes.tolist()
    for tag, xyz in zip(tags, places):
        gmsh.model.mesh.setNode(tag, xyz, [])


def _from_arrays(nodes: Any, cells: Any, read: ReadVtu) -> Mesh:
    """The Mesh of arrays. The server reads serendipity cells and cells of several orders."""
    xyz, blocks, columns = take_arrays(nodes, cells)
    if not blocks or not only_server_reads(blocks):
        return Mesh.from_arrays(nodes, cells)
    return _with_columns(read, columns)(to_msh(xyz, blocks, {}))


def as_mesh(source: Any, read_vtu: ReadVtu) -> Mesh:
    """The Mesh of anything that holds one: a Mesh, (nodes, cells), a meshio mesh, a pyvista grid or the module gmsh.
    `read_vtu` reads cells whose node order only the server knows."""
    if isinstance(source, Mesh):
        return source
    if hasattr(source, "points") and hasattr(source, "celltypes"):
        return from_pyvista(source, read_vtu)
    if hasattr(source, "points") and hasattr(source, "cells"):
        return from_meshio(source, read_vtu)
    if hasattr(source, "model") and hasattr(source.model, "mesh"):
        return from_gmsh(source)
    if isinstance(source, tuple) and len(source) == 2:
        return _from_arrays(source[0], source[1], read_vtu)
    raise BadMesh(f"A {type(source).__name__} is not a mesh; "
                  "give a path of a file, a Mesh, (nodes, cells), a meshio mesh, a pyvista grid or the module gmsh.")  # fmt: skip


# ===== grids of VTK's cells that only the server reads =====

# VTK's types by meshio's names. meshio's linear wedge is numbered like VTK's Lagrange wedge of order 1, not like type 13.
_TYPE_OF = {"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12, "wedge": 73, "pyramid": 14,
          "line3": 21, "triangle6": 22, "quad8": 23, "tetra10": 24, "hexahedron20": 25, "wedge15": 26, "pyramid13": 27,
          "quad9": 28, "hexahedron27": 29, "wedge18": 32, "VTK_LAGRANGE_CURVE": 68, "VTK_LAGRANGE_TRIANGLE": 69,
          "VTK_LAGRANGE_QUADRILATERAL": 70, "VTK_LAGRANGE_TETRAHEDRON": 71, "VTK_LAGRANGE_HEXAHEDRON": 72,
          "VTK_LAGRANGE_WEDGE": 73}  # fmt: skip
# Serendipity cells by meshio's names. Only the server reads them.
_ONLY_IN_FILES = {"quad8", "hexahedron20", "wedge15", "pyramid13"}


@dataclass
class VtkGrid:
    """Points and cells as in a vtkUnstructuredGrid, for the server. It knows the node orders of VTK's Lagrange and serendipity
    cells, which this package does not repeat."""

    points: NDArray[np.float64]  # (points, 3)
    types: NDArray[np.uint8]
    ends: NDArray[np.int64]  # for each cell, where its points end in `connectivity`
    connectivity: NDArray[np.int64]
    data: dict[str, NDArray[np.int64]]  # groups and entities by cell
    groups: dict[str, tuple[int, int]]  # tag and dimension of groups by name
    version: str  # of the file: from 2.1 on, two upright edges of Lagrange hexahedra have changed places

    @classmethod
    def of_pyvista(cls, grid: Any) -> VtkGrid:
        data = getattr(grid, "cell_data", {})
        kept = {"gmsh:physical": np.asarray(data["gmsh:physical"], dtype=np.int64)} if "gmsh:physical" in data else {}
        kinds = np.asarray(grid.celltypes, dtype=np.uint8)
        if "element" in data:
            kept["element"] = _pieces(kinds, np.asarray(data["element"]))
        return cls(_three_columns(grid.points), kinds, np.asarray(grid.offset, dtype=np.int64)[1:],
                   np.asarray(grid.cell_connectivity, dtype=np.int64), kept, {}, "2.1")  # fmt: skip

    @classmethod
    def of_meshio(cls, blocks: list[tuple[str, NDArray[np.int32]]], mesh: Any) -> VtkGrid:
        """`blocks`: the names and nodes of the mesh's blocks. meshio keeps the node order of files before version 2.1."""
        for name, _ in blocks:
            if name not in _TYPE_OF:
                raise BadMesh(f"{name} cells of meshio are not read; read the mesh from an MSH file instead.")
        counts = np.concatenate([np.full(len(nodes), nodes.shape[1]) for _, nodes in blocks])
        data = getattr(mesh, "cell_data", {}) or {}
        kept = {key: np.concatenate([np.asarray(part, dtype=np.int64) for part in data[key]])
                for key in ("gmsh:physical", "gmsh:geometrical") if key in data}  # fmt: skip
        fields = {name: (int(value[0]), int(value[1]))
                  for name, value in (getattr(mesh, "field_data", {}) or {}).items()}  # fmt: skip
        kinds = np.concatenate([np.full(len(nodes), _TYPE_OF[name], dtype=np.uint8) for name, nodes in blocks])
        if "element" in data:
            kept["element"] = _pieces(kinds, np.concatenate([np.asarray(part) for part in data["element"]]))
        return cls(_three_columns(mesh.points), kinds,
                   np.cumsum(counts), np.concatenate([nodes.ravel() for _, nodes in blocks], dtype=np.int64), kept, fields, "1.0")  # fmt: skip

    def to_vtu(self) -> bytes:
        """The grid as a VTU file."""

        def array(kind: str, name: str, values: NDArray[Any], more: str = "") -> str:
            data = np.ascontiguousarray(values).tobytes()
            text = base64.b64encode(np.uint64(len(data)).tobytes() + data).decode()
            return f'<DataArray type="{kind}" Name={quoteattr(name)}{more} format="binary">{text}</DataArray>\n'

        fields = "".join(array("Int64", name, np.array(pair, dtype="<i8"), ' NumberOfTuples="2"')
                         for name, pair in self.groups.items())  # fmt: skip
        cells = (array("Int64", "connectivity", self.connectivity.astype("<i8"))
                 + array("Int64", "offsets", self.ends.astype("<i8")) + array("UInt8", "types", self.types))  # fmt: skip
        data = "".join(array("Int64", name, values.astype("<i8")) for name, values in self.data.items())
        points = array("Float64", "points", self.points.astype("<f8"), ' NumberOfComponents="3"')
        return (f'<VTKFile type="UnstructuredGrid" version="{self.version}" byte_order="LittleEndian" header_type="UInt64">\n'
                f"<UnstructuredGrid>\n<FieldData>\n{fields}</FieldData>\n"
                f'<Piece NumberOfPoints="{len(self.points)}" NumberOfCells="{len(self.types)}">\n'
                f"<Points>\n{points}</Points>\n<Cells>\n{cells}</Cells>\n<CellData>\n{data}</CellData>\n"
                "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n").encode()  # fmt: skip


def _pieces(kinds: NDArray[np.uint8], elements: NDArray[Any]) -> NDArray[np.int64]:
    """The numbers 1, 2, … of the cells, but 0 for pieces of curved lines that go on from the cell before: VariMesh writes
    them so, with the element 0."""
    line = 3
    return np.where((kinds == line) & (elements.ravel() == 0), 0, np.arange(1, len(kinds) + 1))


def _only_in_files(meshio_name: str) -> bool:
    """Whether only the server knows the node order of these cells of meshio."""
    return meshio_name.startswith("VTK_LAGRANGE_") or meshio_name in _ONLY_IN_FILES


def _three_columns(points: Any) -> NDArray[np.float64]:
    xyz = np.asarray(points, dtype=np.float64)
    return xyz if xyz.shape[1] == 3 else np.hstack([xyz, np.zeros((len(xyz), 3 - xyz.shape[1]))])
