"""Reads a Nektar++ file, text or compressed, as its description says, without code of VariMesh. Checks that every cell can
be oriented, and compares the volume and the surface with given values.

usage: check_nektar.py FILE VOLUME SURFACE
"""
import base64
import sys
import xml.etree.ElementTree as tree
import zlib

import numpy as np


def packed(text, kinds):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), np.dtype(kinds))


def is_packed(element):
    return element.get("COMPRESSED") == "B64Z-LittleEndian"


def items(section, width, kind):
    """Numbers of things by their ids."""
    if section is None:
        return {}
    if is_packed(section):
        records = packed(section.text, [("id", "<i8"), ("x", kind, (width,))])
        return {int(record["id"]): record["x"].tolist() for record in records}
    return {int(one.get("ID")): [float(x) if kind == "<f8" else int(x) for x in one.text.split()] for one in section}


def parts(section):
    """The sides of faces or cells by their letter and id."""
    found = {}
    for one in section:
        if is_packed(one):
            width = {"T": 3, "Q": 4, "A": 4, "P": 5, "R": 5, "H": 6}[one.tag]
            found.update({key: (one.tag, value) for key, value in items(one, width, "<i8").items()})
        else:
            found[int(one.get("ID"))] = (one.tag, [int(x) for x in one.text.split()])
    return found


def curves(section):
    found = {"E": {}, "F": {}}
    if section is None:
        return found
    if is_packed(section):
        info = [(name, "<i8") for name in ("id", "of", "count", "points", "first", "type")]
        index = packed(section.find("DATAPOINTS/INDEX").text, "<i8")
        points = packed(section.find("DATAPOINTS/POINTS").text, [("id", "<i8"), ("x", "<f8", (3,))])["x"]
        for letter in "EF":
            if section.find(letter) is not None:
                for one in packed(section.find(letter).text, info):
                    assert one["type"] in (17, 24)
                    found[letter][int(one["of"])] = points[index[one["first"] : one["first"] + one["count"]]]
        return found
    for one in section:
        points = np.array(one.text.split(), float).reshape(-1, 3)
        assert len(points) == int(one.get("NUMPOINTS"))
        assert one.get("TYPE") in ("PolyEvenlySpaced", "NodalTriEvenlySpaced")
        found[one.tag][int(one.get("EDGEID") or one.get("FACEID"))] = points
    return found


def around(edges, sides):
    """The vertices of a face: vertex k is common to edges k and k - 1."""
    return [(set(edges[side]) & set(edges[sides[k - 1]])).pop() for k, side in enumerate(sides)]


def check_cell(letter, faces, of_face):
    """What Nektar++ asserts when it orients a cell."""
    edge = [of_face[face][1] for face in faces]
    if letter == "A":  # the first edges of the triangles are the edges of the base
        assert edge[1][0] == edge[0][0]
        assert edge[2][0] in edge[0] and edge[3][0] in edge[0]
    if letter in "PR":  # those of prisms and pyramids lie on the base, opposite to where the triangle collapses
        for face in faces:
            if of_face[face][0] == "T":
                assert of_face[face][1][0] in edge[0], (letter, of_face[face])


def surface_integrals(order, letter, points):
    """The area and a third of the flux of x through a face, by polynomials through its points."""
    nodes, weights = np.polynomial.legendre.leggauss(2 * order + 8)
    nodes, weights = (nodes + 1) / 2, weights / 2
    u, v = (a.ravel() for a in np.meshgrid(nodes, nodes, indexing="ij"))
    w = np.outer(weights, weights).ravel()
    if letter == "T":
        w, u = w * (1 - v), u * (1 - v)
        powers = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
        at = [(0, 0), (order, 0), (0, order)]
        at += [(k, 0) for k in range(1, order)] + [(order - k, k) for k in range(1, order)]
        at += [(0, order - k) for k in range(1, order)]
        at += [(i, j) for j in range(1, order) for i in range(1, order - j)]
    else:
        powers = [(i, j) for i in range(order + 1) for j in range(order + 1)]
        at = [(i, j) for j in range(order + 1) for i in range(order + 1)]
    at = np.array(at) / order
    values = np.array([at[:, 0] ** i * at[:, 1] ** j for i, j in powers]).T
    weight = np.linalg.solve(values, points)
    x = sum(np.outer(u**i * v**j, weight[k]) for k, (i, j) in enumerate(powers))
    xu = sum(np.outer(i * u ** max(i - 1, 0) * v**j, weight[k]) for k, (i, j) in enumerate(powers))
    xv = sum(np.outer(j * u**i * v ** max(j - 1, 0), weight[k]) for k, (i, j) in enumerate(powers))
    normal = np.cross(xu, xv)
    return w @ np.linalg.norm(normal, axis=1), w @ np.einsum("ij,ij->i", normal, x) / 3


def main():
    geometry = tree.parse(sys.argv[1]).getroot().find("GEOMETRY")
    vertices = items(geometry.find("VERTEX"), 3, "<f8")
    edges = items(geometry.find("EDGE"), 2, "<i8")
    faces, cells = parts(geometry.find("FACE")), parts(geometry.find("ELEMENT"))
    curved = curves(geometry.find("CURVED"))
    uses = {}
    for letter, sides in cells.values():
        check_cell(letter, sides, faces)
        for side in sides:
            uses[side] = uses.get(side, 0) + 1
    assert set(uses.values()) <= {1, 2}
    centre = np.mean(list(vertices.values()), axis=0)
    area = volume = 0.0
    for face, (letter, sides) in faces.items():
        if uses[face] != 1:
            continue
        corners = around(edges, sides)
        order = len(next(iter(curved["E"].values()))) - 1
        points = curved["F"].get(face)
        if points is None:  # a triangle of order 2: its edges, the last one backwards
            assert letter == "T" and order == 2
            middle = [curved["E"][side][1] for side in sides]
            points = np.array([vertices[v] for v in corners] + middle)
        else:
            at = [0, 1, 2] if letter == "T" else [0, order, (order + 1) ** 2 - 1, order * (order + 1)]
            assert np.array_equal(points[at], [vertices[v] for v in corners])
        own, flux = surface_integrals(order, letter, points - centre)
        area += own
        volume += abs(flux)  # the mesh is star-shaped around its centre
    for name, found, wanted in (("volume", volume, float(sys.argv[2])), ("surface", area, float(sys.argv[3]))):
        if abs(found - wanted) > 1e-9 * wanted:
            sys.exit(f"{sys.argv[1]}: the {name} is {found}, not {wanted}")


main()
