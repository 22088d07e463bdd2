#!/usr/bin/env python3
"""coarse_parts.py FOLDER [NAME ...]: five coarse meshes of CAD geometry, orders 2 to 4, written as NAME_pP.msh.

lens      two spheres that meet in a sharp edge, with a bore: sharp edges between smooth faces
plate     a thin plate with rounded corners and three holes
blade     a twisted blade with a sharp trailing edge
thread    a helical ridge on a shaft
nested    three cylinders inside each other, with the surfaces between them in the mesh

Gmsh meshes them so coarsely that some elements are invalid: what `varimesh optimise --repair split` is for. All curved
nodes are where Gmsh puts them. tests/bench/parts measures what becomes of them.
"""
import math
import sys
from pathlib import Path

import gmsh

ORDERS = (2, 3, 4)


def write(folder, name, size, orders, finest):
    """Writes the model in these orders, with elements of this size, and as small as 1 / finest of it."""
    for option, value in (("MeshSizeMin", size / finest), ("MeshSizeMax", size), ("MeshSizeFromCurvature", 0),
                          ("HighOrderOptimize", 0), ("Binary", 1), ("RandomSeed", 1)):
        gmsh.option.setNumber("Mesh." + option, value)
    for order in orders:
        gmsh.model.mesh.clear()
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.model.removePhysicalGroups()
        for dimension, group in ((3, "body"), (2, "skin")):
            tags = [tag for _, tag in gmsh.model.getEntities(dimension)]
            gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, tags, 1), group)
        gmsh.write(str(folder / f"{name}_p{order}.msh"))


def lens(occ):
    body = occ.intersect([(3, occ.addSphere(0, 0, -0.7, 1.2))], [(3, occ.addSphere(0, 0, 0.7, 1.2))])[0]
    occ.cut(body, [(3, occ.addCylinder(0.3, 0, -2, 0, 0, 4, 0.2))])
    return 1


def plate(occ):
    body = [(3, occ.addBox(0, 0, 0, 4, 2, 0.2))]
    occ.synchronize()
    upright = [edge for _, edge in gmsh.model.getEntities(1)
               if abs(gmsh.model.getBoundingBox(1, edge)[5] - gmsh.model.getBoundingBox(1, edge)[2]) > 0.1]
    body = occ.fillet([body[0][1]], upright, [0.5])
    occ.synchronize()
    rim = [edge for _, edge in gmsh.model.getEntities(1) if gmsh.model.getBoundingBox(1, edge)[2] > 0.1]
    body = occ.fillet([body[0][1]], rim, [0.08])
    holes = [(3, occ.addCylinder(x, y, -1, 0, 0, 2, radius)) for x, y, radius in ((1, 1, 0.4), (2.2, 0.7, 0.25), (3.2, 1.2, 0.3))]
    occ.cut(body, holes)
    return 2


def blade(occ):
    def section(height, chord, turn):
        # Half-thicknesses of a thin aerofoil with a closed, sharp trailing edge, along the chord.
        stations = (0, 0.02, 0.1, 0.3, 0.6, 1)
        thickness = [0.3 * math.sqrt(s) - 0.13 * s - 0.35 * s**2 + 0.18 * s**3 for s in stations]
        upper, lower = [], []
        for s, t in zip(stations, thickness):
            for side, points in ((1, upper), (-1, lower)):
                x, y = chord * (s - 0.4), chord * (side * t * (s < 1) + 0.15 * s * (1 - s))
                points.append((x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)))
        nose, tail = (occ.addPoint(*points, height) for points in (upper[0], upper[-1]))
        curves = [occ.addSpline([nose, *(occ.addPoint(x, y, height) for x, y in side[1:-1]), tail])
                  for side in (upper, lower)]
        return occ.addWire(curves)

    occ.addThruSections([section(0, 1.2, 0), section(1, 1, 0.7), section(2, 0.7, 1.4)], makeSolid=True)
    return 0.9


def thread(occ):
    turns, pitch, steps = 1.5, 0.7, 12

    def profile(turn):
        angle, rise = 2 * math.pi * turn, 0.5 + pitch * turn
        corners = [(0.85, -0.2), (1.3, -0.05), (1.3, 0.05), (0.85, 0.2)]
        points = [occ.addPoint(r * math.cos(angle), r * math.sin(angle), rise + z) for r, z in corners]
        return occ.addWire([occ.addLine(points[i], points[(i + 1) % 4]) for i in range(4)])

    ridge = occ.addThruSections([profile(turns * i / steps) for i in range(steps + 1)], makeSolid=True)
    occ.fuse([(3, occ.addCylinder(0, 0, 0, 0, 0, 2.1, 1))], ridge)
    return 3


def nested(occ):
    cylinders = [(3, occ.addCylinder(0, 0, 0, 0, 0, 1.5, radius)) for radius in (1, 0.75, 0.55)]
    occ.fragment(cylinders[:1], cylinders[1:])
    return 2


PARTS = (lens, plate, blade, thread, nested)


def write_all(folder, parts, orders, finest):
    """Makes each part by its function, which builds the geometry and returns the size of elements, and writes it."""
    gmsh.initialize(["", "-v", "1"])
    for make in parts:
        gmsh.model.add(make.__name__)
        size = make(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        write(folder, make.__name__, size, orders, finest)
        gmsh.model.remove()


def main():
    names = sys.argv[2:]
    write_all(Path(sys.argv[1]), [make for make in PARTS if not names or make.__name__ in names], ORDERS, 3)


if __name__ == "__main__":
    main()
