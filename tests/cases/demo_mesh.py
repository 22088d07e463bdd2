#!/usr/bin/python3
"""Makes demo.msh: a box round a ball that has three layers of prisms, in order 2. Needs python3-gmsh.

    demo_mesh.py OUT.msh

Gmsh curves the ball's surface and leaves all other edges straight, so the surface cuts through the layers.
"""
import sys

import gmsh

RADIUS, BOX, SIZE = 0.5, 1.5, 0.6
HEIGHTS = [0.01, 0.025, 0.05]  # of the layers' tops above the ball


class Lines:
    """Lines between points, each made once. A line in the other direction has the negative number."""

    def __init__(self, make):
        self.make, self.made = make, {}

    def __call__(self, one, other):
        if (other, one) in self.made:
            return -self.made[other, one]
        if (one, other) not in self.made:
            self.made[one, other] = self.make(one, other)
        return self.made[one, other]


def ball():
    """The surfaces of the ball: eight triangles between its poles."""
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0)
    poles = [geo.addPoint(*(sign * RADIUS * (i == axis) for i in range(3))) for axis in range(3) for sign in (1, -1)]
    east, west, north, south, top, bottom = poles
    arc = Lines(lambda one, other: geo.addCircleArc(one, centre, other))
    faces = []
    for one, other in ((east, north), (north, west), (west, south), (south, east)):
        for a, b, c in ((one, other, top), (other, one, bottom)):
            loop = geo.addCurveLoop([arc(a, b), arc(b, c), arc(c, a)])
            faces.append(geo.addSurfaceFilling([loop], sphereCenterTag=centre))
    return faces


def box():
    geo = gmsh.model.geo
    corners = {(x, y, z): geo.addPoint(x * BOX, y * BOX, z * BOX) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)}
    line = Lines(lambda one, other: geo.addLine(corners[one], corners[other]))
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            at = []
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = [u, v]
                corner.insert(axis, side)
                at.append(tuple(corner))
            faces.append(geo.addPlaneSurface([geo.addCurveLoop([line(at[i], at[(i + 1) % 4]) for i in range(4)])]))
    return faces


def main(out):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for name in ("MeshSizeMin", "MeshSizeMax"):
        gmsh.option.setNumber(f"Mesh.{name}", SIZE)
    geo = gmsh.model.geo
    sphere = ball()
    gmsh.option.setNumber("Geometry.ExtrudeReturnLateralEntities", 0)
    layers = geo.extrudeBoundaryLayer([(2, face) for face in sphere], [1] * len(HEIGHTS), HEIGHTS, True)
    prisms = [tag for dimension, tag in layers if dimension == 3]
    tops = [layers[i - 1][1] for i, (dimension, _) in enumerate(layers) if dimension == 3]
    walls = box()
    outside = geo.addVolume([geo.addSurfaceLoop(walls), geo.addSurfaceLoop(tops)])
    geo.synchronize()
    for dimension, tags, name in ((2, sphere, "ball"), (2, walls, "box"), (3, [*prisms, outside], "fluid")):
        gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, tags), name)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(out)
    gmsh.finalize()


main(*sys.argv[1:])
