#!/usr/bin/python3
"""made.py FOLDER [NAME ...]: writes sixty STEP files, FOLDER/NAME.step, as strangers send them.

Bodies of bodies.py, assemblies, faces without a body, and files with which something is wrong. Needs Gmsh's Python module.
"""
import math
import sys
from pathlib import Path

import gmsh

import bodies
from bodies import occ, polygon, solids


# Several bodies.


def boxes_side_by_side():
    solids(occ.addBox(0, 0, 0, 20, 20, 20), occ.addBox(20, 0, 0, 15, 20, 20))


def pin_in_plate():
    occ.cut(solids(occ.addBox(-20, -20, 0, 40, 40, 8)), solids(occ.addCylinder(0, 0, 0, 0, 0, 8, 7)))
    occ.addCylinder(0, 0, -6, 0, 0, 20, 7)


def stack_of_discs():
    solids(*(occ.addCylinder(0, 0, 8 * i, 0, 0, 8, radius) for i, radius in enumerate((12, 8, 14, 5))))


def bodies_that_overlap():
    solids(occ.addBox(0, 0, 0, 30, 20, 10), occ.addCylinder(15, 10, 5, 0, 0, 20, 6))


def ball_in_box():
    solids(occ.addBox(-20, -20, -20, 40, 40, 40), occ.addSphere(0, 0, 0, 9))


def bodies_apart():
    solids(occ.addCone(0, 0, 0, 0, 0, 20, 10, 4), occ.addTorus(40, 0, 5, 12, 4))


def same_body_twice():
    solids(occ.addCylinder(0, 0, 0, 0, 0, 20, 8), occ.addCylinder(0, 0, 0, 0, 0, 20, 8))


def touching_along_an_edge():
    solids(occ.addBox(0, 0, 0, 20, 20, 20), occ.addBox(20, 20, 0, 20, 20, 20))


def touching_balls():
    solids(occ.addSphere(0, 0, 0, 10), occ.addSphere(20, 0, 0, 10))


def mirrored_body():
    body = solids(occ.addWedge(0, 0, 0, 30, 20, 15, ltx=12))
    occ.mirror(occ.copy(body), 0, 0, 1, 0)


# Faces without a body.


def plate_in_the_plane():
    occ.cut([(2, occ.addRectangle(0, 0, 0, 60, 40, roundedRadius=8))], [(2, occ.addDisk(30, 20, 0, 9, 9))])


def aerofoil_in_a_box():
    outline = [(x, side * 0.6 * (0.2969 * math.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4))
               for side, places in ((1, (1, 0.7, 0.4, 0.15, 0.03, 0)), (-1, (0.03, 0.15, 0.4, 0.7))) for x in places]
    points = [occ.addPoint(30 * x, 30 * y, 0) for x, y in outline]
    wing = occ.addCurveLoop([occ.addSpline(points[:6]), occ.addSpline(points[5:] + points[:1])])
    occ.addPlaneSurface([polygon([(-40, -40, 0), (80, -40, 0), (80, 40, 0), (-40, 40, 0)]), wing])


def tilted_disc():
    occ.rotate([(2, occ.addDisk(0, 0, 0, 20, 12))], 0, 0, 0, 1, 1, 0, 0.7)


def open_box():
    """A box without its lid."""
    box = occ.addBox(0, 0, 0, 20, 20, 10)
    occ.synchronize()
    faces = [pair for pair in gmsh.model.getBoundary(solids(box), False, False)]
    lid = next(face for face in faces if gmsh.model.getBoundingBox(*face)[2] > 9)
    occ.remove(solids(box))
    occ.remove([lid])


def side_of_a_cylinder():
    occ.extrude([(1, occ.addCircle(0, 0, 0, 10))], 0, 0, 20)


def wires():
    occ.addCircle(0, 0, 0, 10)
    occ.addCircle(0, 0, 5, 8)


# Something is wrong, or looks as if it were.


def self_crossing_ring():
    """A torus whose tube is thicker than the ring."""
    occ.addTorus(0, 0, 0, 8, 12)


def crossed_outline():
    """An outline that crosses itself, extruded."""
    occ.extrude([(2, occ.addPlaneSurface([polygon([(0, 0, 0), (20, 20, 0), (20, 0, 0), (0, 20, 0)])]))], 0, 0, 10)


def foil():
    """A thousand times as wide as thick."""
    occ.addBox(0, 0, 0, 50, 50, 0.05)


def tangent_hole():
    """A hole that touches the side of its plate: a cusp."""
    occ.cut(solids(occ.addBox(0, 0, 0, 40, 30, 8)), solids(occ.addCylinder(20, 6, -1, 0, 0, 10, 6)))


def holes_nearly_touching():
    occ.cut(solids(occ.addBox(0, 0, 0, 40, 30, 8)), solids(*(occ.addCylinder(20 + x, 15, -1, 0, 0, 10, 6) for x in (-6.02, 6.02))))


def tiny_step():
    """Two faces that are a hundredth of a millimetre out of line."""
    occ.fuse(solids(occ.addBox(0, 0, 0, 20, 20, 10)), solids(occ.addBox(20, 0, 0, 20, 20, 10.01)))


def microscopic():
    occ.cut(solids(occ.addBox(0, 0, 0, 0.02, 0.02, 0.01)), solids(occ.addCylinder(0.01, 0.01, -0.01, 0, 0, 0.03, 0.004)))


def enormous():
    occ.cut(solids(occ.addBox(0, 0, 0, 2e6, 2e6, 1e6)), solids(occ.addCylinder(1e6, 1e6, -1e6, 0, 0, 3e6, 4e5)))


def far_from_the_origin():
    occ.cut(solids(occ.addBox(1e5, 2e5, 0, 40, 30, 10)), solids(occ.addCylinder(1e5 + 20, 2e5 + 15, -1, 0, 0, 12, 7)))


# Files that are changed after they were written.


def in_metres(text):
    return text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")


def cut_off(text):
    return text[:len(text) // 2]


def no_step_file(text):
    return "A model follows by post.\n"


ASSEMBLIES = (boxes_side_by_side, pin_in_plate, stack_of_discs, bodies_that_overlap, ball_in_box, bodies_apart, same_body_twice,
              touching_along_an_edge, touching_balls, mirrored_body)
FACES = (plate_in_the_plane, aerofoil_in_a_box, tilted_disc, open_box, side_of_a_cylinder, wires)
STRANGE = (self_crossing_ring, crossed_outline, foil, tangent_hole, holes_nearly_touching, tiny_step, microscopic, enormous,
           far_from_the_origin)
CHANGED = (in_metres, cut_off, no_step_file)
NAMES = tuple(make.__name__ for make in bodies.ALL + ASSEMBLIES + FACES + STRANGE + CHANGED)


def write(folder, name):
    """Writes a model."""
    path = folder / f"{name}.step"
    makers = {make.__name__: make for make in bodies.ALL + ASSEMBLIES + FACES + STRANGE + CHANGED}
    change = makers[name] if makers[name] in CHANGED else None
    gmsh.initialize(["", "-v", "1"])
    try:
        (bodies.lug if change else makers[name])()
        occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    if change:
        path.write_text(change(path.read_text()))
    return path


def main():
    for name in sys.argv[2:] or NAMES:
        write(Path(sys.argv[1]), name)


if __name__ == "__main__":
    main()
