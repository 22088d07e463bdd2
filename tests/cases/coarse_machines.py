#!/usr/bin/env python3
"""coarse_machines.py FOLDER [NAME ...] [--orders ORDER ...]: coarse meshes of twelve machine parts, orders 3 and 4.

shaft     a stepped shaft with fillets, grooves, keyways and cross holes: more than a hundred faces
fan       a hub with seven twisted blades of B-spline faces
rocket    a body lofted through many sections, with fins, a window band and nozzles: B-spline faces
solid     a block with fillets on its edges and bosses
axle      a shaft with a flange, bolt holes and two bearing seats
casing    the volute of a pump with two flanges
gear      a spur gear with fillets at the feet of its teeth, and a bore
nozzle    a bell nozzle with cooling holes
holes     a bracket with many holes and fillets
manifold  an elbow with three branches
crank     a crank with two throws
impeller  a disc with six curved blades under a shroud

Writes FOLDER/NAME.brep and FOLDER/NAME_pP.msh. Gmsh makes the models with OpenCASCADE, and meshes them so coarsely that
many elements are invalid with the boundary that it makes. tests/bench/machines measures what becomes of them.
"""
import argparse
import math
from pathlib import Path

import gmsh

ORDERS = (3, 4)


def box_of(edge):
    box = gmsh.model.getBoundingBox(1, edge)
    return [(box[axis] + box[axis + 3]) / 2 for axis in range(3)], [box[axis + 3] - box[axis] for axis in range(3)]


def rounded(occ, body, radius, wanted):
    """The body with fillets on the edges for whose middle and extent `wanted` is true."""
    occ.synchronize()
    edges = [edge for _, edge in gmsh.model.getBoundary(gmsh.model.getBoundary(body, False), False, False)
             if wanted(*box_of(edge))]
    return occ.fillet([body[0][1]], sorted(set(edges)), [radius])


def cylinder(occ, start, axis, radius):
    return (3, occ.addCylinder(*start, *axis, radius))


def around(count, radius, phase=0.0):
    return [(radius * math.cos(2 * math.pi * i / count + phase), radius * math.sin(2 * math.pi * i / count + phase))
            for i in range(count)]


def loft(occ, sections, pieces=1):
    """A solid through closed splines, each a list of points. Every section consists of this many splines."""
    wires = []
    for section in sections:
        points = [occ.addPoint(*point) for point in section]
        points, length = [*points, points[0]], len(points) // pieces
        add = occ.addBSpline if pieces == 1 else occ.addSpline
        wires.append(occ.addWire([add(points[length * i:length * (i + 1) + 1]) for i in range(pieces)]))
    return occ.addThruSections(wires, makeSolid=True)


def shaft(occ):
    steps = [(0, 2, 0.5), (2, 1, 0.7), (3, 3, 0.9), (6, 0.6, 1.2), (6.6, 2.4, 0.8), (9, 1.5, 0.6), (10.5, 1, 0.45)]
    body = occ.fuse([cylinder(occ, (0, 0, steps[0][0]), (0, 0, steps[0][1]), steps[0][2])],
                    [cylinder(occ, (0, 0, z), (0, 0, length), radius) for z, length, radius in steps[1:]])[0]
    grooves = []
    for z, radius in ((0.4, 0.5), (0.8, 0.5), (3.4, 0.9), (3.8, 0.9), (4.2, 0.9), (8.6, 0.8), (9.6, 0.6), (10.0, 0.6)):
        ring = occ.cut([cylinder(occ, (0, 0, z), (0, 0, 0.15), radius + 0.2)],
                       [cylinder(occ, (0, 0, z - 0.1), (0, 0, 0.35), radius - 0.08)])[0]
        grooves += ring
    keys = [(3, occ.addBox(-0.12, radius - 0.15, z, 0.24, 1, length)) for z, length, radius in ((4.7, 1, 0.9), (7, 1.2, 0.8))]
    splines = [(3, occ.addBox(-0.05, 0.4, 10.7, 0.1, 0.2, 1)) for _ in range(10)]
    for i, spline in enumerate(splines):
        occ.rotate([spline], 0, 0, 0, 0, 0, 1, 2 * math.pi * i / len(splines))
    holes = [cylinder(occ, (-2, 0, z), (4, 0, 0), radius) for z, radius in ((1.4, 0.12), (2.5, 0.15), (5.2, 0.2))]
    bolts = [cylinder(occ, (x, y, 5.9), (0, 0, 0.8), 0.08) for x, y in around(8, 1.05)]
    occ.cut(body, grooves + keys + splines + holes + bolts)
    return 0.7


def twisted(occ, root, tip, chord, turn, phase):
    """A blade from the radius root to the radius tip, along x, turned around z by the phase."""
    sections = []
    for i in range(4):
        share = i / 3
        radius, angle = root + share * (tip - root), 0.9 - turn * share
        section = []
        for j in range(10):
            t = 2 * math.pi * j / 10
            u, v = chord * (1 + 0.4 * share) / 2 * math.cos(t), 0.16 * chord * math.sin(t)
            section.append((radius, u * math.cos(angle) - v * math.sin(angle), u * math.sin(angle) + v * math.cos(angle)))
        sections.append(section)
    blade = loft(occ, sections)
    occ.rotate(blade, 0, 0, 0, 0, 0, 1, phase)
    return blade


def fan(occ):
    hub = occ.cut([cylinder(occ, (0, 0, -0.5), (0, 0, 1), 0.7)], [cylinder(occ, (0, 0, -1), (0, 0, 2), 0.25)])[0]
    blades = [blade for i in range(7) for blade in twisted(occ, 0.55, 2.2, 0.7, 0.6, 2 * math.pi * i / 7)]
    occ.fuse(hub, blades)
    return 0.34


def rocket(occ):
    outline = [(0, 0.5), (1, 0.62), (2.5, 0.7), (4, 0.7), (5.5, 0.62), (6.5, 0.42), (7.2, 0.18)]
    body = loft(occ, [[(radius * math.cos(t), radius * math.sin(t), z) for t in (2 * math.pi * j / 12 for j in range(12))]
                      for z, radius in outline], 4)
    fins = []
    for i in range(4):
        sections = []
        for radius, chord, rise in ((0.45, 1.8, 1.2), (0.9, 1.3, 0.8), (1.5, 0.8, 0.3)):
            sections.append([(radius, 0.12 * chord / 1.8 * math.sin(t), rise + chord / 2 * math.cos(t))
                             for t in (2 * math.pi * j / 10 for j in range(10))])
        fin = loft(occ, sections)
        occ.rotate(fin, 0, 0, 0, 0, 0, 1, math.pi / 2 * i)
        fins += fin
    bells = [(3, occ.addCone(x, y, -0.5, 0, 0, 0.7, 0.16, 0.1)) for x, y in around(3, 0.28)]
    body = occ.fuse(body, fins + bells)[0]
    windows = [cylinder(occ, (0, 0, z), (1.5 * math.cos(t), 1.5 * math.sin(t), 0), 0.16)
               for z in (3, 4.2, 5.2) for t in (0.5, 2.1, 3.7, 5.3)]
    core = cylinder(occ, (0, 0, 2.6), (0, 0, 3), 0.3)
    occ.cut(body, windows + [core])
    return 0.9


def solid(occ):
    body = rounded(occ, [(3, occ.addBox(0, 0, 0, 4, 3, 1.5))], 0.4, lambda middle, extent: True)
    bosses = [cylinder(occ, (x, y, 1), (0, 0, 1.3), 0.45) for x, y in ((1, 0.9), (3, 2.1))]
    body = occ.fuse(body, bosses)[0]
    body = rounded(occ, body, 0.12, lambda middle, extent: middle[2] > 2.2)
    occ.cut(body, [cylinder(occ, (x, y, -1), (0, 0, 4), 0.25) for x, y in ((1, 0.9), (3, 2.1), (1, 2.2), (3, 0.8))])
    return 1.3


def axle(occ):
    body = occ.fuse([cylinder(occ, (0, 0, 0), (0, 0, 8), 0.5)],
                    [cylinder(occ, (0, 0, 1), (0, 0, 0.4), 1.6), cylinder(occ, (0, 0, 2), (0, 0, 1), 0.7),
                     cylinder(occ, (0, 0, 6), (0, 0, 1), 0.7), (3, occ.addCone(0, 0, 3, 0, 0, 1, 0.7, 0.5)),
                     (3, occ.addSphere(0, 0, 8, 0.6))])[0]
    occ.cut(body, [cylinder(occ, (x, y, 0), (0, 0, 2), 0.2) for x, y in around(5, 1.15)] +
            [cylinder(occ, (0, 0, -1), (0, 0, 6), 0.2), (3, occ.addTorus(0, 0, 5, 0.55, 0.15))])
    return 1.0


def casing(occ):
    sections = []
    for i in range(7):
        angle, radius = 2 * math.pi * i / 7.5, 0.35 + 0.06 * i
        middle = 1.3 + 0.5 * radius
        sections.append([((middle + radius * math.cos(t)) * math.cos(angle), (middle + radius * math.cos(t)) * math.sin(angle),
                          radius * math.sin(t)) for t in (2 * math.pi * j / 8 for j in range(8))])
    volute = loft(occ, sections)
    drum = cylinder(occ, (0, 0, -0.5), (0, 0, 1), 1.35)
    outlet = cylinder(occ, (1.7, -1.2, 0), (0, 2.4, 0), 0.5)
    flanges = [cylinder(occ, (1.7, 1.2, 0), (0, 0.25, 0), 0.9), cylinder(occ, (0, 0, 0.4), (0, 0, 0.5), 0.8)]
    body = occ.fuse([drum], volute + [outlet] + flanges)[0]
    bores = [cylinder(occ, (0, 0, -0.3), (0, 0, 3), 0.5), cylinder(occ, (1.7, -0.6, 0), (0, 3, 0), 0.32)]
    bolts = [cylinder(occ, (1.7 + x, 1, y), (0, 1, 0), 0.1) for x, y in around(4, 0.7, 0.4)]
    occ.cut(body, bores + bolts)
    return 0.6


def gear(occ):
    teeth, points = 10, []
    for i in range(teeth):
        for share, radius in ((0.0, 1.6), (0.28, 1.6), (0.4, 2.0), (0.62, 2.0), (0.74, 1.6)):
            angle = 2 * math.pi * (i + share) / teeth
            points.append(occ.addPoint(radius * math.cos(angle), radius * math.sin(angle), 0))
    lines = []
    for i in range(teeth):
        corner = [points[(5 * i + j) % len(points)] for j in range(6)]
        centre = occ.addPoint(0, 0, 0)
        lines += [occ.addCircleArc(corner[0], centre, corner[1]), occ.addLine(corner[1], corner[2]),
                  occ.addCircleArc(corner[2], centre, corner[3]), occ.addLine(corner[3], corner[4]),
                  occ.addCircleArc(corner[4], centre, corner[5])]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    body = [entity for entity in occ.extrude([(2, face)], 0, 0, 0.6) if entity[0] == 3]
    body = rounded(occ, body, 0.14, lambda middle, extent: extent[2] > 0.5 and math.hypot(*middle[:2]) < 1.7)
    occ.cut(body, [cylinder(occ, (0, 0, -1), (0, 0, 3), 0.5)] +
            [cylinder(occ, (x, y, -1), (0, 0, 3), 0.22) for x, y in around(5, 1.0)])
    return 0.8


def nozzle(occ):
    outer = [(0, 1.0), (0.8, 0.95), (1.5, 0.62), (2.2, 0.75), (3.2, 1.15), (4.2, 1.4)]
    inner = [(-0.1, 0.8), (0.8, 0.76), (1.5, 0.42), (2.2, 0.58), (3.2, 1.0), (4.3, 1.3)]

    def turned(outline):
        curve = occ.addBSpline([occ.addPoint(radius, 0, z) for z, radius in outline])
        ends = [occ.addPoint(0, 0, outline[0][0]), occ.addPoint(0, 0, outline[-1][0])]
        first, last = (gmsh.model.occ.addPoint(outline[i][1], 0, outline[i][0]) for i in (0, -1))
        face = occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(ends[0], first), curve, occ.addLine(last, ends[1]),
                                                      occ.addLine(ends[1], ends[0])])])
        return [entity for entity in occ.revolve([(2, face)], 0, 0, 0, 0, 0, 1, 2 * math.pi) if entity[0] == 3]

    body = occ.cut(turned(outer), turned(inner))[0]
    body = occ.fuse(body, occ.cut([cylinder(occ, (0, 0, 0), (0, 0, 0.3), 1.4)], [cylinder(occ, (0, 0, -1), (0, 0, 3), 0.9)])[0])[0]
    occ.cut(body, [cylinder(occ, (x, y, -1), (0, 0, 2), 0.1) for x, y in around(6, 1.2)] +
            [cylinder(occ, (0, 0, 0.6), (2 * math.cos(t), 2 * math.sin(t), 0), 0.1) for t in (0, 1.5, 3, 4.5)])
    return 0.8


def holes(occ):
    body = occ.fuse([(3, occ.addBox(0, 0, 0, 4, 2, 0.4))], [(3, occ.addBox(0, 0, 0, 0.4, 2, 2.5))])[0]
    body = rounded(occ, body, 0.5, lambda middle, extent: math.dist(middle[::2], (0.4, 0.4)) < 1e-4)
    body = rounded(occ, body, 0.4, lambda middle, extent: extent[2] < 0.5 and extent[2] > 0.3 and middle[0] > 3)
    body = rounded(occ, body, 0.4, lambda middle, extent: extent[0] > 0.3 and extent[0] < 0.5 and middle[2] > 2)
    occ.cut(body, [cylinder(occ, (x, y, -1), (0, 0, 2), radius) for x, y, radius in
                   ((1.5, 0.5, 0.2), (1.5, 1.5, 0.2), (2.5, 1, 0.4), (3.4, 0.5, 0.15), (3.4, 1.5, 0.15))] +
            [cylinder(occ, (-1, y, z), (2, 0, 0), radius) for y, z, radius in
             ((0.5, 1.2, 0.18), (1.5, 1.2, 0.18), (1, 1.9, 0.35))])
    return 1.0


def manifold(occ):
    def pipe(radius):
        start, corner, end = occ.addPoint(0, 0, 0), occ.addPoint(0, 0, 2), occ.addPoint(1.5, 0, 3.5)
        centre = occ.addPoint(1.5, 0, 2)
        far = occ.addPoint(4, 0, 3.5)
        path = occ.addWire([occ.addLine(start, corner), occ.addCircleArc(corner, centre, end), occ.addLine(end, far)])
        return occ.addPipe([(2, occ.addDisk(0, 0, 0, radius, radius))], path)

    branches = [((0, 0, 1), (-1.6, 0, 0)), ((2.4, 0, 3.5), (0, 1.6, 0)), ((3.2, 0, 3.5), (0, -1.1, 1.1))]
    outer = [entity for entity in pipe(0.55) if entity[0] == 3]
    inner = [entity for entity in pipe(0.4) if entity[0] == 3]
    body = occ.fuse(outer, [cylinder(occ, *branch, 0.35) for branch in branches] +
                    [cylinder(occ, (0, 0, 0), (0, 0, 0.25), 0.9)])[0]
    occ.cut(body, inner + [cylinder(occ, *branch, 0.23) for branch in branches])
    return 0.52


def crank(occ):
    pieces = [cylinder(occ, (0, 0, z), (0, 0, 1.2), 0.4) for z in (0, 3.4, 6.8)]
    pieces += [cylinder(occ, (side * 0.9, 0, z), (0, 0, 1.2), 0.35) for side, z in ((1, 1.7), (-1, 5.1))]
    for side, z in ((1, 1.1), (1, 2.8), (-1, 4.5), (-1, 6.2)):
        pieces += [cylinder(occ, (0, 0, z), (0, 0, 0.7), 0.75), cylinder(occ, (side * 0.9, 0, z), (0, 0, 0.7), 0.6),
                   (3, occ.addBox(min(0, side * 0.9), -0.55, z, 0.9, 1.1, 0.7))]
    body = occ.fuse(pieces[:1], pieces[1:])[0]
    occ.cut(body, [cylinder(occ, (0, 0, -1), (0, 0, 2), 0.15), cylinder(occ, (0.9, -2, 2.3), (0, 4, 0), 0.1),
                   cylinder(occ, (-0.9, -2, 5.7), (0, 4, 0), 0.1)])
    return 1.0


def impeller(occ):
    body = [cylinder(occ, (0, 0, 0), (0, 0, 0.25), 2)]
    pieces = [cylinder(occ, (0, 0, 0), (0, 0, 1.1), 0.5)]
    shroud = occ.cut([cylinder(occ, (0, 0, 0.8), (0, 0, 0.2), 2)], [cylinder(occ, (0, 0, 0), (0, 0, 2), 1.1)])[0]
    blades = []
    for i in range(6):
        sections = []
        for z in (0.1, 0.9):
            inner, outer = [], []
            for j in range(6):
                radius, angle = 0.6 + 1.3 * j / 5, 0.9 * j / 5 + 0.1 * z
                half = 0.06 + 0.06 * math.sin(math.pi * j / 5)
                inner.append((radius * math.cos(angle - half / radius), radius * math.sin(angle - half / radius), z))
                outer.append((radius * math.cos(angle + half / radius), radius * math.sin(angle + half / radius), z))
            sections.append(inner + outer[::-1])
        blade = loft(occ, sections)
        occ.rotate(blade, 0, 0, 0, 0, 0, 1, 2 * math.pi * i / 6)
        blades += blade
    body = occ.fuse(body, pieces + shroud + blades)[0]
    occ.cut(body, [cylinder(occ, (0, 0, -1), (0, 0, 3), 0.22)])
    return 0.8


MACHINES = (shaft, fan, rocket, solid, axle, casing, gear, nozzle, holes, manifold, crank, impeller)


def write(folder, name, size, orders):
    """The model as BREP, and its meshes. Gmsh reads the file again, so the meshes have the tags of the file."""
    model = folder / f"{name}.brep"
    gmsh.write(str(model))
    gmsh.clear()
    gmsh.model.occ.importShapes(str(model))
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), size)
    for option, value in (("MeshSizeMin", size / 4), ("MeshSizeMax", size), ("MeshSizeFromCurvature", 0),
                          ("HighOrderOptimize", 0), ("Binary", 1), ("RandomSeed", 1), ("SaveAll", 1)):
        gmsh.option.setNumber("Mesh." + option, value)
    gmsh.model.mesh.generate(3)
    if not gmsh.model.mesh.getElements(3)[0]:
        raise RuntimeError(f"gmsh makes no volume elements of {name}")
    for order in orders:
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(folder / f"{name}_p{order}.msh"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("name", nargs="*", help="default: all")
    parser.add_argument("--orders", type=int, nargs="+", default=ORDERS)
    options = parser.parse_intermixed_args()
    for make in MACHINES:
        if not options.name or make.__name__ in options.name:
            gmsh.initialize(["", "-v", "1"])
            size = make(gmsh.model.occ)
            gmsh.model.occ.synchronize()
            write(options.folder, make.__name__, size, options.orders)
            print(make.__name__, len(gmsh.model.getEntities(2)), "faces,", len(gmsh.model.getEntities(3)), "bodies,",
                  len(gmsh.model.mesh.getElements(3)[1][0]), "elements", flush=True)
            gmsh.finalize()


if __name__ == "__main__":
    main()
