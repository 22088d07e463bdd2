#!/usr/bin/python3
"""check_hdf5.py KIND FILE VOLUME AREA: reads a mesh of HOPR, CGNS or PyFR, and compares it with what is known of it.

The mesh is a grid of the unit cube under the map (x + y^2 / 2, y, z + x y / 4). This reader shares nothing with VariMesh's:
it takes the arrays with h5py, with libcgns or with VTK, as the formats' descriptions have them. It takes every node back through
the inverse of the map, where it must lie at its place on the lattice of a straight cell, and integrates over faces: x . n / 3,
which adds up to the volume, and 1 over the boundary, which is its area. hdf5/peers_test.cpp runs it.
"""
import itertools
import sys

import h5py
import numpy as np

NAMES = {4: "tet", 5: "pyr", 6: "pri", 8: "hex"}
# The corners of each shape on a lattice of one step.
CORNERS = {
    4: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    5: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)],
    6: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    8: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
# CGNS SIDS: the corners of each face, in order seen from outside.
SIDES = {
    4: [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    5: [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
    6: [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5), (0, 2, 1), (3, 4, 5)],
    8: [(0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (4, 5, 6, 7)],
}
# PyFR: the corners of each face, in any order.
PYFR_FACES = {
    4: [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)],
    5: [(0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 3, 4)],
    6: [(0, 1, 2), (3, 4, 5), (0, 1, 3, 4), (1, 2, 4, 5), (0, 2, 3, 5)],
    8: [(0, 1, 2, 3), (0, 1, 4, 5), (1, 2, 5, 6), (2, 3, 6, 7), (0, 3, 4, 7), (4, 5, 6, 7)],
}


def on_lattice(shape, p, i, j, k):
    return {4: i + j + k <= p, 5: i + k <= p and j + k <= p, 6: i + j <= p, 8: True}[shape]


def rows(shape, p):
    """The lattice row by row: i fastest, then j, then k."""
    return [(i, j, k) for k, j, i in itertools.product(range(p + 1), repeat=3) if on_lattice(shape, p, i, j, k)]


def straight(x):
    """The inverse of the map."""
    y = x[..., 1]
    u = x[..., 0] - y**2 / 2
    return np.stack([u, y, x[..., 2] - u * y / 4], axis=-1)


def check_places(shape, p, nodes):
    """`nodes`: the place of each node by its position on the lattice."""
    corners = [straight(nodes[tuple(p * c for c in corner)]) for corner in CORNERS[shape]]
    along = {4: (1, 2, 3), 5: (1, 3, 4), 6: (1, 2, 3), 8: (1, 3, 4)}[shape]
    for at, x in nodes.items():
        wanted = corners[0] + sum(n / p * (corners[a] - corners[0]) for n, a in zip(at, along))
        # A map of degree 2 is exact from order 2 on.
        assert np.abs(wanted - straight(x)).max() < 1e-12, (NAMES[shape], p, at)


class Face:
    """A rule for the faces of one number of corners and one order."""

    rules = {}

    def __init__(self, corners, p):
        places = [(i, j) for j in range(p + 1) for i in range(p + 1) if corners == 4 or i + j <= p]
        powers = [(a, b) for a in range(p + 1) for b in range(p + 1) if corners == 4 or a + b <= p]
        t, w = np.polynomial.legendre.leggauss(24)
        t, w = (1 + t) / 2, w / 2
        u, v = np.meshgrid(t, t, indexing="ij")
        weight = np.outer(w, w)
        if corners == 3:  # the square collapses onto the triangle
            weight, v = weight * (1 - u), v * (1 - u)
        u, v = u.ravel(), v.ravel()
        vander = np.array([[(i / p) ** a * (j / p) ** b for a, b in powers] for i, j in places])
        values = np.array([[s**a * r**b for a, b in powers] for s, r in zip(u, v)])
        by_u = np.array([[a * s ** max(a - 1, 0) * r**b for a, b in powers] for s, r in zip(u, v)])
        by_v = np.array([[b * s**a * r ** max(b - 1, 0) for a, b in powers] for s, r in zip(u, v)])
        inverse = np.linalg.inv(vander)
        self.places, self.weight = places, weight.ravel()
        self.at, self.by_u, self.by_v = values @ inverse, by_u @ inverse, by_v @ inverse

    @classmethod
    def integrals(cls, shape, p, nodes, side):
        """x . n / 3 and 1 over a side, whose corners are in order seen from outside."""
        corners = [np.array(CORNERS[shape][c]) for c in side]
        rule = cls.rules.setdefault((len(side), p), None) or cls(len(side), p)
        cls.rules[(len(side), p)] = rule
        o, a, b = corners[0], corners[1] - corners[0], corners[-1] - corners[0]
        x = np.array([nodes[tuple(int(c) for c in p * o + i * a + j * b)] for i, j in rule.places])
        normal = np.cross(rule.by_u @ x, rule.by_v @ x)
        return (np.einsum("ij,ij,i", rule.at @ x, normal, rule.weight) / 3,
                np.sqrt((normal**2).sum(1)) @ rule.weight)


def measure(shape, p, nodes):
    return [Face.integrals(shape, p, nodes, side) for side in SIDES[shape]]


def hopr(path):
    with h5py.File(path) as f:
        p, info, sides = int(f.attrs["Ngeo"][0]), f["ElemInfo"][:], f["SideInfo"][:]
        x, ids, names = f["NodeCoords"][:], f["GlobalNodeIDs"][:], f["BCNames"][:]
        assert [int(f.attrs[name][0]) for name in ("nElems", "nSides", "nNodes", "nUniqueNodes", "nBCs")] == [
            len(info), len(sides), len(x), len(np.unique(ids)), len(names)]
        assert int(f.attrs["nUniqueSides"][0]) == len(np.unique(np.abs(sides[:, 1])))
        assert [name.decode().strip() for name in names] == ["left", "right", "front", "back", "bottom", "top"]
    volume = area = 0
    corner_ids = []
    for kind, _, first_side, last_side, first, last in info:
        shape = kind % 10
        lattice = rows(shape, p)
        assert last - first == len(lattice) and last_side - first_side == len(SIDES[shape])
        nodes = dict(zip(lattice, x[first:last]))
        number = dict(zip(lattice, ids[first:last]))
        corner_ids.append([number[tuple(p * c for c in corner)] for corner in CORNERS[shape]])
        check_places(shape, p, nodes)
        for side, (part, size) in enumerate(measure(shape, p, nodes)):
            volume += part
            area += size if sides[first_side + side][2] == 0 else 0
    for (kind, _, first_side, *_), own in zip(info, corner_ids):
        for side, corners in enumerate(SIDES[kind % 10]):
            _, _, neighbour, place, group = sides[first_side + side]
            assert (neighbour == 0) == (group > 0)
            if neighbour == 0:
                continue
            # The neighbour's corner number `flip` is the first one here, and it goes round the other way.
            other = SIDES[info[neighbour - 1][0] % 10][place // 10 - 1]
            turned = [corner_ids[neighbour - 1][other[(place % 10 - 1 - k) % len(other)]] for k in range(len(other))]
            assert turned == [own[c] for c in corners]
    return volume, area


def pyfr(path):
    shapes = {name: shape for shape, name in NAMES.items()}
    with h5py.File(path) as f:
        codec = [name.decode() for name in f["codec"]]
        assert f["version"][()] == 1 and f["creator"][()].startswith(b"varimesh")
        assert len(f["mesh-uuid"][()].decode()) == 36
        nodes, eles = f["nodes"][:], {name: f["eles"][name][:] for name in f["eles"]}
        parts = f["partitionings/1/eles"]
        regions, order = parts.attrs["regions"][0], parts[:]
    assert list(regions) == list(np.cumsum([0] + [len(eles[name]) for name in sorted(eles)]))
    for n, name in enumerate(sorted(eles)):
        assert sorted(order[regions[n]:regions[n + 1]]) == list(range(len(eles[name])))
    used = np.concatenate([e["nodes"].ravel() for e in eles.values()])
    assert np.array_equal(np.bincount(used), nodes["valency"])
    volume = area = 0
    faces = {}
    for name, all_of_shape in eles.items():
        shape = shapes[name]
        p = next(p for p in range(1, 11) if len(rows(shape, p)) == all_of_shape["nodes"].shape[1])
        lattice = rows(shape, p)
        for e, element in enumerate(all_of_shape):
            at = dict(zip(lattice, nodes["location"][element["nodes"]]))
            number = dict(zip(lattice, element["nodes"]))
            check_places(shape, p, at)
            assert element["curved"] == (p > 1)
            for face, (code, other) in enumerate(element["faces"]):
                corners = {number[tuple(p * c for c in CORNERS[shape][v])] for v in PYFR_FACES[shape][face]}
                faces[codec.index(f"eles/{name}/{face}"), e] = (code, other, corners)
                side = next(s for s in SIDES[shape] if set(s) == set(PYFR_FACES[shape][face]))
                part, size = Face.integrals(shape, p, at, side)
                volume += part
                if other == -1:
                    assert codec[code] in {f"bc/{side}" for side in ("left", "right", "front", "back", "bottom", "top")}
                    area += size
    for (code, e), (other_code, other, corners) in faces.items():
        if other >= 0:
            assert faces[other_code, other] == (code, e, corners)
    return volume, area


def cgns_vtk(path):
    """The elements as VTK sees them: three points inside each, and the volume of the straight elements."""
    import vtk
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    reader.EnableAllBases()
    reader.Update()

    def leaves(node):
        for n in range(node.GetNumberOfBlocks()):
            block = node.GetBlock(n)
            if block is not None:
                yield from leaves(block) if block.IsA("vtkMultiBlockDataSet") else [block]

    volume = 0
    for grid in leaves(reader.GetOutput()):
        for n in range(grid.GetNumberOfCells()):
            cell = grid.GetCell(n)
            if cell.GetCellDimension() < 3:
                continue
            weights = [0.0] * cell.GetNumberOfPoints()

            def place(*at):
                x = [0.0, 0.0, 0.0]
                cell.EvaluateLocation(vtk.reference(0), tuple(map(float, at)), x, weights)
                return straight(np.array(x))

            origin = place(0, 0, 0)
            edges = [place(*at) - origin for at in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
            for at in ((0.2, 0.3, 0.4), (0.1, 0.1, 0.7), (0.6, 0.15, 0.2)):
                wanted = origin + sum(s * edge for s, edge in zip(at, edges))
                assert np.abs(wanted - place(*at)).max() < 1e-9, (n, cell.GetCellType())
            volume += np.linalg.det(edges) / {4: 6, 5: 2, 6: 1}[cell.GetNumberOfFaces()]
    return volume, None


def cgns_library(path):
    """The elements as libcgns reads them."""
    import ctypes
    lib = ctypes.CDLL("libcgns.so.3.4")
    lib.cg_get_error.restype = ctypes.c_char_p

    def call(name, *arguments):
        assert getattr(lib, name)(*arguments) == 0, (name, lib.cg_get_error())

    def integer():
        return ctypes.c_int()

    file, count, text = integer(), integer(), ctypes.create_string_buffer(64)
    call("cg_open", path.encode(), 0, ctypes.byref(file))
    size = (ctypes.c_int * 9)()
    call("cg_zone_read", file, 1, 1, text, size)
    x = np.zeros((3, size[0]))
    first, last = (ctypes.c_int * 1)(1), (ctypes.c_int * 1)(size[0])
    for k, name in enumerate((b"CoordinateX", b"CoordinateY", b"CoordinateZ")):
        call("cg_coord_read", file, 1, 1, name, 4, first, last, x[k].ctypes.data_as(ctypes.c_void_p))
    types = {10: (4, 1), 11: (4, 2), 30: (4, 3), 47: (4, 4), 12: (5, 1), 13: (5, 2), 33: (5, 3), 50: (5, 4), 14: (6, 1),
             16: (6, 2), 36: (6, 3), 53: (6, 4), 17: (8, 1), 19: (8, 2), 39: (8, 3), 56: (8, 4)}
    cells, sides = 0, 0
    call("cg_nsections", file, 1, 1, ctypes.byref(count))
    for s in range(1, count.value + 1):
        kind, begin, end, bound, parents, length = (integer() for _ in range(6))
        call("cg_section_read", file, 1, 1, s, text, *map(ctypes.byref, (kind, begin, end, bound, parents)))
        call("cg_ElementDataSize", file, 1, 1, s, ctypes.byref(length))
        nodes = np.zeros(length.value, dtype=np.int32)
        call("cg_elements_read", file, 1, 1, s, nodes.ctypes.data_as(ctypes.c_void_p), None)
        number = end.value - begin.value + 1
        nodes = nodes.reshape(number, -1) - 1
        if kind.value not in types:
            sides += number
            continue
        cells += number
        shape, p = types[kind.value]
        along = {4: (1, 2, 3), 5: (1, 3, 4), 6: (1, 2, 3), 8: (1, 3, 4)}[shape]
        for own in nodes:
            # CGNS lists the nodes of the edges after the corners; the corners show that the file holds the map.
            corners = straight(x.T[own[:len(CORNERS[shape])]])
            for corner, at in zip(CORNERS[shape], corners):
                wanted = corners[0] + sum(n * (corners[a] - corners[0]) for n, a in zip(corner, along))
                assert np.abs(wanted - at).max() < 1e-12
            if p > 1:
                edge = straight(x.T[own[len(CORNERS[shape])]])
                assert np.abs(edge - (corners[0] + (corners[1] - corners[0]) / p)).max() < 1e-12
    assert cells == size[1] and sides > 0
    call("cg_nbocos", file, 1, 1, ctypes.byref(count))
    members, names = 0, []
    for b in range(1, count.value + 1):
        values = [integer() for _ in range(6)]
        normal = (ctypes.c_int * 3)()
        call("cg_boco_info", file, 1, 1, b, text, *map(ctypes.byref, values[:3]), normal, *map(ctypes.byref, values[3:]))
        names.append(text.value.decode())
        points = np.zeros(values[2].value, dtype=np.int32)
        call("cg_boco_read", file, 1, 1, b, points.ctypes.data_as(ctypes.c_void_p), None)
        members += points[1] - points[0] + 1 if values[1].value == 4 else len(points)
    assert names == ["left", "right", "front", "back", "bottom", "top"] and members == sides, (names, members, sides)
    call("cg_close", file)
    return None, None


if __name__ == "__main__":
    found = {"hopr": hopr, "pyfr": pyfr, "cgns-vtk": cgns_vtk, "cgns-library": cgns_library}[sys.argv[1]](sys.argv[2])
    for own, wanted in zip(found, map(float, sys.argv[3:])):
        assert own is None or abs(own - wanted) < 1e-9 * max(1, wanted), (own, wanted)
