"""Conversion of meshes from and to meshio, pyvista and Gmsh's API. Any object with their attributes works."""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BadMesh
from .mesh import Block, Mesh, shape_name

# Cells whose nodes meshio has in VTK's order, which differs from Gmsh's. Gmsh's node i is meshio's node order[i].
_FROM_MESHIO = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron27": [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26],
}


def from_meshio(mesh: Any) -> Mesh:
    """The Mesh of a meshio.Mesh: its `points` and `cells`, and any groups in `cell_data` and `field_data`."""
    data = getattr(mesh, "cell_data", {}) or {}
    blocks: list[Block] = []
    for i, cells in enumerate(mesh.cells):
        name, nodes = (cells.type, cells.data) if hasattr(cells, "type") else cells
        if name.startswith("VTK_"):
            raise BadMesh(f"The nodes of the {name} cells are in VTK's order; read the mesh from an MSH file instead.")
        array = np.asarray(nodes)
        if name in _FROM_MESHIO:
            array = array[:, _FROM_MESHIO[name]]
        entities, groups = (_column(data, key, i, len(array)) for key in ("gmsh:geometrical", "gmsh:physical"))
        blocks += _by_entity(shape_name(name), array.astype(np.int32), entities, groups)
    names = {(int(value[1]), int(value[0])): name for name, value in (getattr(mesh, "field_data", {}) or {}).items()}
    return Mesh.from_arrays(mesh.points, blocks, names)


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


# VTK's cell types of order 1 and 2, as meshio names them. Lagrange cells of order 2 have the node order of the others,
# except hexahedra and prisms.
_VTK_TYPES = {1: "vertex", 3: "line", 5: "triangle", 9: "quad", 10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid",
              21: "line3", 22: "triangle6", 24: "tetra10", 28: "quad9", 29: "hexahedron27"}  # fmt: skip
_VTK_LAGRANGE = {68: "line", 69: "triangle", 70: "quad", 71: "tetra"}
_SECOND_ORDER = {"line": 3, "triangle": 6, "quad": 9, "tetra": 10}


def _vtk_name(kind: int, nodes: int) -> str:
    """meshio's name for a VTK type. BadMesh for types that are not read."""
    if kind in _VTK_TYPES:
        return _VTK_TYPES[kind]
    shape = _VTK_LAGRANGE.get(kind, "")
    if shape and _SECOND_ORDER[shape] == nodes:
        return f"{shape}{nodes}"
    raise BadMesh(f"Cells of the VTK type {kind} with {nodes} nodes are not read from pyvista, only cells of order 1 and most "
                  "of order 2; read the mesh from an MSH file instead.")  # fmt: skip


def from_pyvista(grid: Any) -> Mesh:
    """The Mesh of a pyvista.UnstructuredGrid: cells of order 1 or 2, with the cell array "gmsh:physical" if there is one."""
    kinds, offsets = np.asarray(grid.celltypes), np.asarray(grid.offset)
    connectivity = np.asarray(grid.cell_connectivity)
    counts = np.diff(offsets)
    data = getattr(grid, "cell_data", {})
    groups = np.asarray(data["gmsh:physical"] if "gmsh:physical" in data else np.zeros(len(kinds)), dtype=np.int64)
    blocks: list[Block] = []
    changes = np.flatnonzero((np.diff(kinds) != 0) | (np.diff(counts) != 0) | (np.diff(groups) != 0)) + 1
    for piece in np.split(np.arange(len(kinds)), changes):
        if not len(piece):
            continue
        first, count, group = piece[0], int(counts[piece[0]]), int(groups[piece[0]])
        name = _vtk_name(int(kinds[first]), count)
        array = connectivity[offsets[first] : offsets[piece[-1] + 1]].reshape(-1, count)
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
    for tag, xyz in zip(mesh.node_tags.tolist(), mesh.nodes.tolist()):
        gmsh.model.mesh.setNode(tag, xyz, [])


def as_mesh(source: Any) -> Mesh:
    """The Mesh of anything that holds one: a Mesh, (nodes, cells), a meshio mesh, a pyvista grid or the module gmsh."""
    if isinstance(source, Mesh):
        return source
    if hasattr(source, "points") and hasattr(source, "celltypes"):
        return from_pyvista(source)
    if hasattr(source, "points") and hasattr(source, "cells"):
        return from_meshio(source)
    if hasattr(source, "model") and hasattr(source.model, "mesh"):
        return from_gmsh(source)
    if isinstance(source, tuple) and len(source) == 2:
        return Mesh.from_arrays(*source)
    raise BadMesh(f"A {type(source).__name__} is not a mesh; "
                  "give a path of a file, a Mesh, (nodes, cells), a meshio mesh, a pyvista grid or the module gmsh.")  # fmt: skip
