"""A mesh in arrays, and its conversion to and from the messages in which it is sent."""
from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import wire
from .errors import BadMesh
from .names import counted, suggestion
from .v1 import mesh_pb2

MAX_ORDER = 10
_PART_NUMBERS = 131072  # node numbers of at most five bytes each: a part stays below 1 MiB
_PART_NODES = 32768

_NODES: dict[str, Callable[[int], int]] = {
    "point": lambda p: 1,
    "line": lambda p: p + 1,
    "triangle": lambda p: (p + 1) * (p + 2) // 2,
    "quadrilateral": lambda p: (p + 1) ** 2,
    "tetrahedron": lambda p: (p + 1) * (p + 2) * (p + 3) // 6,
    "pyramid": lambda p: (p + 1) * (p + 2) * (2 * p + 3) // 6,
    "prism": lambda p: (p + 1) ** 2 * (p + 2) // 2,
    "hexahedron": lambda p: (p + 1) ** 3,
}
DIMENSION = {"point": 0, "line": 1, "triangle": 2, "quadrilateral": 2}
_ALIASES = {"vertex": "point", "tri": "triangle", "quad": "quadrilateral", "tet": "tetrahedron", "tetra": "tetrahedron",
            "pyra": "pyramid", "wedge": "prism", "hex": "hexahedron", "hexa": "hexahedron"}  # fmt: skip
_SHAPES = {name: mesh_pb2.Shape.Value("SHAPE_" + name.upper()) for name in _NODES}


def shape_name(name: str) -> str:
    """The name of a shape: triangle, quadrilateral, …. Also takes meshio's names: tetra10 gives tetrahedron."""
    plain = name.rstrip("0123456789").lower()
    plain = _ALIASES.get(plain, plain)
    if plain not in _NODES:
        raise BadMesh(f"There is no shape '{name}'; {suggestion(plain, _NODES)}")
    return plain


def nodes_of(shape: str, order: int) -> int:
    """The number of nodes of a cell."""
    return _NODES[shape](order)


@dataclass(repr=False)
class Block:
    """Elements of one shape on one entity of the geometry."""

    shape: str
    nodes: NDArray[np.int32]  # (elements, nodes per element): indices from 0, in Gmsh's order
    entity: int = 1
    physical: tuple[int, ...] = ()  # tags of the groups to which the elements belong

    def __repr__(self) -> str:
        groups = f" in group {', '.join(map(str, self.physical))}" if self.physical else ""
        return f"<{len(self.nodes)} of shape {self.shape} on entity {self.entity}{groups}>"

    @property
    def dimension(self) -> int:
        return DIMENSION.get(self.shape, 3)


@dataclass(repr=False)
class Mesh:
    """Nodes, elements and groups. Elements of one dimension less than the cells mark boundaries and interfaces."""

    nodes: NDArray[np.float64]  # (nodes, 3), in any unit of length
    blocks: list[Block]
    order: int
    groups: dict[tuple[int, int], str] = field(default_factory=dict)  # names of groups, by dimension and tag
    node_tags: NDArray[np.int64] | None = None  # the numbers of the nodes in their source
    columns: int = 3  # how many coordinates per node the caller gave

    @classmethod
    def from_arrays(
        cls,
        nodes: ArrayLike,
        cells: Mapping[str, ArrayLike] | Iterable[tuple[str, ArrayLike] | Block],
        groups: Mapping[tuple[int, int], str] | None = None,
    ) -> Mesh:
        """A mesh from nodes (n, 2) or (n, 3) and cells by shape, such as {"triangle": an array (m, k)}: node indices from 0,
        in Gmsh's order."""
        xyz, blocks, columns = take_arrays(nodes, cells)
        return cls(xyz, blocks, _check(blocks, len(xyz)), dict(groups or {}), columns=columns)

    def __repr__(self) -> str:
        shapes = ", ".join(f"{len(nodes)} {shape}" for shape, nodes in self.cells.items())
        return f"<mesh of order {self.order} in {self.dimension}-D: {counted(len(self.nodes), 'node')}; cells: {shapes}>"

    @property
    def dimension(self) -> int:
        """The dimension of the cells: 2 or 3."""
        return max(block.dimension for block in self.blocks)

    @property
    def cells(self) -> dict[str, NDArray[np.int32]]:
        """The cells of the highest dimension, by shape."""
        cells: dict[str, list[NDArray[np.int32]]] = {}
        for block in self.blocks:
            if block.dimension == self.dimension:
                cells.setdefault(block.shape, []).append(block.nodes)
        return {shape: np.concatenate(arrays) for shape, arrays in cells.items()}

    def moved(self, nodes: ArrayLike) -> Mesh:
        """The same mesh with other positions of its nodes."""
        return replace(self, nodes=np.asarray(nodes, dtype=np.float64))


def take_arrays(
    nodes: ArrayLike, cells: Mapping[str, ArrayLike] | Iterable[tuple[str, ArrayLike] | Block]
) -> tuple[NDArray[np.float64], list[Block], int]:
    """The nodes with three coordinates, the blocks that are not empty, and how many coordinates were given."""
    xyz = _coordinates(nodes)
    if xyz.ndim != 2 or xyz.shape[1] not in (2, 3) or len(xyz) == 0:
        raise BadMesh(f"The nodes are an array of shape {xyz.shape}; give (n, 2) or (n, 3).")
    columns = xyz.shape[1]
    if columns == 2:
        xyz = np.hstack([xyz, np.zeros((len(xyz), 1))])
    if not np.isfinite(xyz).all():
        row = int(np.flatnonzero(~np.isfinite(xyz).all(axis=1))[0])
        raise BadMesh(f"The coordinates of node {row} are not finite.")
    pairs = cells.items() if isinstance(cells, Mapping) else cells
    blocks = [pair if isinstance(pair, Block) else Block(shape_name(pair[0]), indices(*pair)) for pair in pairs]
    blocks = [block for block in blocks if len(block.nodes)]
    return np.ascontiguousarray(xyz), blocks, columns


def _rows(values: ArrayLike) -> NDArray[Any]:
    """The values as an array of numbers if they are one, or if their rows are, as other programs have them."""
    with suppress(TypeError, ValueError):  # rows of several lengths
        array = np.asarray(values)
        if array.dtype.kind != "O":
            return array
    with suppress(TypeError, ValueError):
        return np.array([list(row) for row in values])  # type: ignore[union-attr, arg-type]
    return np.empty((), dtype=object)


def _coordinates(nodes: ArrayLike) -> NDArray[np.float64]:
    array = _rows(nodes)
    if array.dtype.kind not in "iuf":
        raise BadMesh("The nodes are not an array of numbers; give (n, 2) or (n, 3).")
    return array.astype(np.float64)


def indices(shape: str, nodes: ArrayLike) -> NDArray[np.int32]:
    """The nodes of cells of a shape, from an array of integers or from rows of lists. BadMesh if they are neither."""
    array = _rows(nodes)
    if array.ndim != 2 or (array.size and array.dtype.kind not in "iu"):
        raise BadMesh(f"The nodes of {shape} are {array.dtype} of shape {array.shape}; give integers (elements, nodes).")
    return array.astype(np.int32)


def _check(blocks: Sequence[Block], count: int) -> int:
    """Checks the blocks, and returns the order that all of them have."""
    orders: dict[int, Block] = {}
    for block in blocks:
        if block.nodes.min() < 0 or block.nodes.max() >= count:
            wrong = int(block.nodes.max() if block.nodes.max() >= count else block.nodes.min())
            raise BadMesh(f"A {block.shape} has the node {wrong}, but nodes are 0 to {count - 1}.")
        columns = block.nodes.shape[1]
        fitting = [p for p in range(1, MAX_ORDER + 1) if nodes_of(block.shape, p) == columns]
        if not fitting:
            raise BadMesh(f"No {block.shape} of order 1 to {MAX_ORDER} has {columns} nodes; "
                          "serendipity cells and cells of several orders go to optimise() as (nodes, cells).")  # fmt: skip
        if block.shape != "point":
            orders.setdefault(fitting[0], block)
    if not any(block.dimension >= 2 for block in blocks):
        raise BadMesh("There are no cells; give triangles, quadrilaterals, tetrahedra, pyramids, prisms or hexahedra.")
    if len(orders) > 1:
        (one, first), (other, second) = list(orders.items())[:2]
        raise BadMesh(f"A {first.shape} has order {one} and a {second.shape} order {other}; all must have the same "
                      "here. Give optimise() (nodes, cells), which takes cells of several orders.")  # fmt: skip
    return next(iter(orders))


# ===== parts =====


def to_parts(mesh: Mesh) -> Iterator[bytes]:
    """The mesh as MeshPart messages, each preceded by its length."""

    def part(number: int, payload: bytes) -> bytes:
        message = wire.field(number, payload)
        return wire.varint(len(message)) + message

    header = mesh_pb2.MeshHeader(dimension=mesh.dimension, order=mesh.order, nodes=len(mesh.nodes),
                                 node_set=mesh_pb2.NODE_SET_EQUISPACED)  # fmt: skip
    yield part(1, header.SerializeToString())
    for first in range(0, len(mesh.nodes), _PART_NODES):
        yield part(2, wire.field(1, mesh.nodes[first : first + _PART_NODES].astype("<f8").tobytes()))
    for block in mesh.blocks:
        about = mesh_pb2.ElementPart(shape=_SHAPES[block.shape], entity=block.entity, physical=block.physical)
        step = max(1, _PART_NUMBERS // block.nodes.shape[1])
        for first in range(0, len(block.nodes), step):
            nodes = wire.field(4, wire.pack(block.nodes[first : first + step]))
            yield part(3, about.SerializeToString() + nodes)
    for (dimension, tag), name in mesh.groups.items():
        yield part(4, mesh_pb2.PhysicalGroup(dimension=dimension, tag=tag, name=name).SerializeToString())


def from_parts(data: bytes) -> Mesh:
    """The mesh of messages that to_parts() or the server made."""
    header = mesh_pb2.MeshHeader()
    coordinates: list[NDArray[np.float64]] = []
    blocks: list[Block] = []
    groups: dict[tuple[int, int], str] = {}
    names = {number: name for name, number in _SHAPES.items()}
    for message in wire.messages(memoryview(data)):
        for number, payload in wire.fields(message):
            assert isinstance(payload, memoryview)
            if number == 1:
                header.ParseFromString(bytes(payload))
            elif number == 2:
                coordinates += [np.frombuffer(bytes(packed), "<f8") for _, packed in wire.fields(payload)]
            elif number == 3:
                about = bytearray()
                nodes = b""
                for key, value in wire.fields(payload):
                    if key == 4:
                        assert isinstance(value, memoryview)
                        nodes = bytes(value)
                    elif isinstance(value, int):
                        about += wire.varint(key << 3) + wire.varint(value)
                    else:
                        about += wire.field(key, bytes(value))
                found = mesh_pb2.ElementPart.FromString(bytes(about))
                shape = names[found.shape]
                indices = wire.unpack(nodes).astype(np.int32).reshape(-1, nodes_of(shape, header.order))
                blocks.append(Block(shape, indices, found.entity, tuple(found.physical)))
            elif number == 4:
                group = mesh_pb2.PhysicalGroup.FromString(bytes(payload))
                groups[group.dimension, group.tag] = group.name
    return Mesh(np.concatenate(coordinates).reshape(-1, 3), blocks, header.order, groups)


# ===== files of Gmsh, for cells that only the server reads =====

_EDGES = {"triangle": 3, "quadrilateral": 4, "pyramid": 8, "prism": 9, "hexahedron": 12}
# The types of Gmsh for complete elements, by order from 1 on, and for serendipity elements, from order 2 on. 0 stands
# for an order that has no serendipity element.
_COMPLETE = {
    "point": [15],
    "line": [1, 8, 26, 27, 28, 62, 63, 64, 65, 66],
    "triangle": [2, 9, 21, 23, 25, 42, 43, 44, 45, 46],
    "quadrilateral": [3, 10, 36, 37, 38, 47, 48, 49, 50, 51],
    "tetrahedron": [4, 11, 29, 30, 31, 71, 72, 73, 74, 75],
    "pyramid": [7, 14, 118, 119, 120, 121, 122, 123, 124],
    "prism": [6, 13, 90, 91, 106, 107, 108, 109, 110],
    "hexahedron": [5, 12, 92, 93, 94, 95, 96, 97, 98],
}
_SERENDIPITY = {
    "triangle": [0, 20, 22, 24, 52, 53, 54, 55, 56],
    "quadrilateral": [16, 39, 40, 41, 57, 58, 59, 60, 61],
    "pyramid": [19, 125, 126, 127, 128, 129, 130, 131],
    "prism": [18, 111, 112, 113, 114, 115, 116, 117],
    "hexahedron": [17, 99, 100, 101, 102, 103, 104, 105],
}


def _complete_order(shape: str, count: int) -> int:
    """The order of the complete cell that has this number of nodes, or 0 if no order has it."""
    return next((order for order in range(1, MAX_ORDER + 1) if nodes_of(shape, order) == count), 0)


def _type_of(block: Block) -> int:
    """The type of the block's cells in Gmsh, or 0 if Gmsh has none. A complete cell comes before a serendipity cell."""
    count = block.nodes.shape[1]
    if order := _complete_order(block.shape, count):
        types = _COMPLETE[block.shape]
        return types[order - 1] if order <= len(types) else 0
    for order, number in enumerate(_SERENDIPITY.get(block.shape, []), 2):
        if nodes_of(block.shape, 1) + _EDGES[block.shape] * (order - 1) == count:
            return number
    return 0


def only_server_reads(blocks: Sequence[Block]) -> bool:
    """Whether the cells are of several orders, or serendipity cells, and all of a kind that Gmsh has."""
    orders = {_complete_order(block.shape, block.nodes.shape[1]) for block in blocks if block.shape != "point"}
    return (len(orders) > 1 or 0 in orders) and all(_type_of(block) for block in blocks)


def to_msh(nodes: NDArray[np.float64], blocks: Sequence[Block], groups: Mapping[tuple[int, int], str]) -> bytes:
    """The mesh as an MSH 2.2 file. The first node has the number 1."""
    file = io.BytesIO()
    file.write(b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
    if groups:
        lines = "".join(f'{dimension} {tag} "{name}"\n' for (dimension, tag), name in groups.items())
        file.write(f"$PhysicalNames\n{len(groups)}\n{lines}$EndPhysicalNames\n".encode())
    file.write(f"$Nodes\n{len(nodes)}\n".encode())
    np.savetxt(file, np.column_stack([np.arange(1, len(nodes) + 1), nodes]), "%d %.17g %.17g %.17g")
    count = sum(len(block.nodes) * max(1, len(block.physical)) for block in blocks)
    file.write(f"$EndNodes\n$Elements\n{count}\n".encode())
    first = 1
    for block in blocks:
        for group in block.physical or (0,):  # an element is repeated for each further group
            numbers = np.arange(first, first + len(block.nodes))
            about = np.tile([_type_of(block), 2, group, block.entity], (len(block.nodes), 1))
            np.savetxt(file, np.column_stack([numbers, about, block.nodes.astype(np.int64) + 1]), "%d")
            first += len(block.nodes)
    file.write(b"$EndElements\n")
    return file.getvalue()
