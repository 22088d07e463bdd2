"""Bodies that people draw: most of the models of made.py. Each function draws into gmsh.model.occ."""
import math

import gmsh

occ = gmsh.model.occ
WHOLE = 2 * math.pi


def solids(*tags):
    return [(3, tag) for tag in tags]


def around(count, radius, phase=0.0):
    return [(radius * math.cos(WHOLE * i / count + phase), radius * math.sin(WHOLE * i / count + phase)) for i in range(count)]


def edges_of(body, wanted):
    """The edges of the body for whose middle and extent `wanted` is true."""
    occ.synchronize()
    found = []
    for _, edge in {pair for pair in gmsh.model.getBoundary(gmsh.model.getBoundary(body, False, False), False, False)}:
        box = gmsh.model.getBoundingBox(1, edge)
        if wanted([(box[i] + box[i + 3]) / 2 for i in range(3)], [box[i + 3] - box[i] for i in range(3)]):
            found.append(edge)
    return sorted(found)


def upright(middle, extent):
    return extent[2] > 10 * max(extent[0], extent[1], 1e-3)


def polygon(points):
    tags = [occ.addPoint(*point) for point in points]
    lines = [occ.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1])]
    return occ.addCurveLoop(lines)


def plate_with_holes():
    plate = solids(occ.addBox(0, 0, 0, 60, 40, 6))
    occ.cut(plate, solids(*(occ.addCylinder(x, y, -1, 0, 0, 8, 5) for x, y in ((12, 12), (48, 12), (12, 28), (48, 28)))))


def plate_with_fillets():
    body = solids(occ.addBox(0, 0, 0, 40, 30, 10))
    occ.fillet([body[0][1]], edges_of(body, upright), [6])


def box_with_chamfers():
    body = solids(occ.addBox(0, 0, 0, 30, 20, 10))
    edges = edges_of(body, upright)
    faces = [next(face for _, face in gmsh.model.getBoundary(body, False, False)
                  if edge in {abs(tag) for _, tag in gmsh.model.getBoundary([(2, face)], False, False)}) for edge in edges]
    occ.chamfer([body[0][1]], edges, faces, [3])


def rounded_block():
    body = solids(occ.addBox(0, 0, 0, 30, 20, 12))
    occ.fillet([body[0][1]], edges_of(body, lambda middle, extent: True), [4])


def tee():
    occ.fuse(solids(occ.addCylinder(-30, 0, 0, 60, 0, 0, 9)), solids(occ.addCylinder(0, 0, 0, 0, 0, 30, 7)))


def hollow_tee():
    occ.cut(occ.fuse(solids(occ.addCylinder(-30, 0, 0, 60, 0, 0, 9)), solids(occ.addCylinder(0, 0, 0, 0, 0, 30, 8)))[0],
            solids(occ.addCylinder(-31, 0, 0, 62, 0, 0, 6), occ.addCylinder(0, 0, 0, 0, 0, 31, 5)))


def elbow():
    ring = occ.addDisk(20, 0, 0, 6, 6)
    occ.rotate([(2, ring)], 20, 0, 0, 1, 0, 0, math.pi / 2)
    occ.revolve([(2, ring)], 0, 0, 0, 0, 0, 1, math.pi / 2)


def hollow_elbow():
    rings = [occ.addDisk(20, 0, 0, radius, radius) for radius in (6, 4)]
    face = occ.cut([(2, rings[0])], [(2, rings[1])])[0]
    occ.rotate(face, 20, 0, 0, 1, 0, 0, math.pi / 2)
    occ.revolve(face, 0, 0, 0, 0, 0, 1, math.pi / 2)


def flange():
    body = occ.fuse(solids(occ.addCylinder(0, 0, 0, 0, 0, 8, 30)), solids(occ.addCylinder(0, 0, 0, 0, 0, 30, 15)))[0]
    occ.cut(body, solids(occ.addCylinder(0, 0, -1, 0, 0, 40, 10), *(occ.addCylinder(x, y, -1, 0, 0, 10, 3) for x, y in around(6, 23))))


def angle_bracket():
    body = occ.fuse(solids(occ.addBox(0, 0, 0, 40, 20, 5)), solids(occ.addBox(0, 0, 0, 5, 20, 30)))[0]
    occ.fillet([body[0][1]], edges_of(body, lambda middle, extent: extent[1] > 15 and abs(middle[0] - 5) < 0.1 and abs(middle[2] - 5) < 0.1),
               [6])
    occ.cut(solids(body[0][1]), solids(occ.addCylinder(28, 10, -1, 0, 0, 8, 5)))


def lug():
    body = occ.fuse(solids(occ.addBox(0, -10, 0, 30, 20, 8)), solids(occ.addCylinder(30, 0, 0, 0, 0, 8, 10)))[0]
    occ.cut(body, solids(occ.addCylinder(30, 0, -1, 0, 0, 10, 5)))


def stepped_shaft():
    occ.fuse(solids(occ.addCylinder(0, 0, 0, 0, 0, 30, 8)),
             solids(occ.addCylinder(0, 0, 30, 0, 0, 15, 12), occ.addCylinder(0, 0, 45, 0, 0, 25, 7)))


def keyed_shaft():
    occ.cut(solids(occ.addCylinder(0, 0, 0, 0, 0, 50, 10)), solids(occ.addBox(-3, 6, 10, 6, 10, 25)))


def hexagonal_nut():
    body = occ.extrude([(2, occ.addPlaneSurface([polygon([(x, y, 0) for x, y in around(6, 12)])]))], 0, 0, 9)
    occ.cut([pair for pair in body if pair[0] == 3], solids(occ.addCylinder(0, 0, -1, 0, 0, 12, 5.5)))


def i_beam():
    points = [(-15, 0), (15, 0), (15, 3), (1.5, 3), (1.5, 27), (15, 27), (15, 30), (-15, 30), (-15, 27), (-1.5, 27), (-1.5, 3), (-15, 3)]
    occ.extrude([(2, occ.addPlaneSurface([polygon([(x, y, 0) for x, y in points])]))], 0, 0, 80)


def hopper():
    occ.cut(solids(occ.addCone(0, 0, 0, 0, 0, 40, 8, 25)), solids(occ.addCone(0, 0, -0.1, 0, 0, 40.2, 6, 23)))


def cone_with_tip():
    occ.addCone(0, 0, 0, 0, 0, 30, 12, 0)


def bottle():
    points = [occ.addPoint(x, 0, z) for x, z in ((0, 0), (15, 0), (16, 8), (15, 25), (7, 36), (6, 44), (0, 44))]
    lines = [occ.addLine(points[0], points[1]), occ.addSpline(points[1:6]), occ.addLine(points[5], points[6]),
             occ.addLine(points[6], points[0])]
    occ.revolve([(2, occ.addPlaneSurface([occ.addCurveLoop(lines)]))], 0, 0, 0, 0, 0, 1, WHOLE)


def half_turn():
    occ.addCylinder(0, 0, 0, 0, 0, 20, 10, angle=math.pi)


def quarter_ball():
    occ.addSphere(0, 0, 0, 15, 0, math.pi / 2, math.pi / 2)


def ring():
    occ.addTorus(0, 0, 0, 20, 6)


def piece_of_ring():
    occ.addTorus(0, 0, 0, 20, 6, angle=1.8)


def egg():
    body = solids(occ.addSphere(0, 0, 0, 10))
    occ.dilate(body, 0, 0, 0, 1.6, 1, 0.8)


def ball_with_hole():
    occ.cut(solids(occ.addSphere(0, 0, 0, 15)), solids(occ.addCylinder(0, 0, -20, 0, 0, 40, 5)))


def ball_with_flat():
    occ.cut(solids(occ.addSphere(0, 0, 0, 15)), solids(occ.addBox(-20, -20, 9, 40, 40, 20)))


def hollow_ball():
    occ.cut(solids(occ.addSphere(0, 0, 0, 15)), solids(occ.addSphere(0, 0, 0, 9)))


def lens():
    occ.intersect(solids(occ.addSphere(0, 0, -14, 20)), solids(occ.addSphere(0, 0, 14, 20)))


def wedge():
    occ.addWedge(0, 0, 0, 30, 20, 15, ltx=12)


def loft():
    wires = [occ.addWire([occ.addEllipse(0, 0, z, a, b)]) for z, a, b in ((0, 14, 8), (15, 9, 9), (35, 12, 6))]
    occ.addThruSections(wires, makeSolid=True)


def square_to_round():
    square = [occ.addPoint(x, y, 0) for x, y in around(4, 15, math.pi / 4)]
    circle, middle = [occ.addPoint(x, y, 30) for x, y in around(4, 9, math.pi / 4)], occ.addPoint(0, 0, 30)
    wires = [occ.addWire([occ.addLine(square[i], square[(i + 1) % 4]) for i in range(4)]),
             occ.addWire([occ.addCircleArc(circle[i], middle, circle[(i + 1) % 4]) for i in range(4)])]
    occ.addThruSections(wires, makeSolid=True, makeRuled=True)


def twisted_bar():
    wires = [polygon([(x, y, 8 * i) for x, y in around(4, 8, 0.25 * i)]) for i in range(6)]
    occ.addThruSections(wires, makeSolid=True)


def bent_pipe():
    points = [occ.addPoint(*at) for at in ((0, 0, 0), (0, 0, 20), (10, 5, 35), (30, 10, 40))]
    occ.addPipe([(2, occ.addDisk(0, 0, 0, 4, 4))], occ.addWire([occ.addSpline(points)]))


def spring():
    points = [occ.addPoint(12 * math.cos(t), 12 * math.sin(t), 9 * t / WHOLE) for t in (WHOLE * i / 8 for i in range(13))]
    disc = occ.addDisk(12, 0, 0, 2.5, 2.5)
    occ.rotate([(2, disc)], 12, 0, 0, 1, 0, 0, math.pi / 2)
    occ.addPipe([(2, disc)], occ.addWire([occ.addSpline(points)]))


def wing():
    sections = []
    for z, chord, shift in ((0, 30, 0), (25, 22, 6), (50, 12, 14)):
        outline = [(x, s * 0.6 * (0.2969 * math.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4))
                   for s, places in ((1, (1, 0.7, 0.4, 0.15, 0.03, 0)), (-1, (0.03, 0.15, 0.4, 0.7))) for x in places]
        points = [occ.addPoint(shift + chord * x, chord * y, z) for x, y in outline]
        sections.append(occ.addWire([occ.addSpline(points[:6]), occ.addSpline(points[5:] + points[:1])]))
    occ.addThruSections(sections, makeSolid=True)


def propeller():
    hub, blades = solids(occ.addCylinder(0, 0, -6, 0, 0, 12, 8)), []
    for i in range(3):
        blade = occ.addThruSections([occ.addWire([occ.addEllipse(0, 0, z, 7, 1.5)]) for z in (5, 18, 30)], makeSolid=True)
        occ.rotate(blade, 0, 0, 0, 1, 0, 0, math.pi / 2)
        occ.rotate(blade, 0, 0, 0, 0, 1, 0, 0.6)
        occ.rotate(blade, 0, 0, 0, 0, 0, 1, WHOLE * i / 3)
        blades += blade
    occ.fuse(hub, blades)


def gear():
    points = []
    for i in range(12):
        for share, radius in ((0, 16), (0.3, 16), (0.45, 20), (0.65, 20)):
            points.append((radius * math.cos(WHOLE * (i + share) / 12), radius * math.sin(WHOLE * (i + share) / 12), 0))
    body = [pair for pair in occ.extrude([(2, occ.addPlaneSurface([polygon(points)]))], 0, 0, 8) if pair[0] == 3]
    occ.cut(body, solids(occ.addCylinder(0, 0, -1, 0, 0, 10, 6)))


def heat_sink():
    body = solids(occ.addBox(0, 0, 0, 40, 30, 5))
    occ.fuse(body, solids(*(occ.addBox(2 + 6.2 * i, 0, 5, 3, 30, 15) for i in range(6))))


def crossed_holes():
    occ.cut(solids(occ.addBox(-15, -15, -15, 30, 30, 30)),
            solids(occ.addCylinder(-20, 0, 0, 40, 0, 0, 6), occ.addCylinder(0, -20, 0, 0, 40, 0, 6),
                   occ.addCylinder(0, 0, -20, 0, 0, 40, 6)))


def impeller_disc():
    body = solids(occ.addCylinder(0, 0, 0, 0, 0, 5, 25))
    vanes = solids(*(occ.addBox(8, -1.5, 4, 16, 3, 10) for _ in range(5)))
    for i, vane in enumerate(vanes):
        occ.rotate([vane], 0, 0, 0, 0, 0, 1, WHOLE * i / 5)
    occ.fuse(body, vanes)


ALL = (plate_with_holes, plate_with_fillets, box_with_chamfers, rounded_block, tee, hollow_tee, elbow, hollow_elbow, flange,
       angle_bracket, lug, stepped_shaft, keyed_shaft, hexagonal_nut, i_beam, hopper, cone_with_tip, bottle, half_turn, quarter_ball,
       ring, piece_of_ring, egg, ball_with_hole, ball_with_flat, hollow_ball, lens, wedge, loft, square_to_round, twisted_bar,
       bent_pipe, spring, wing, propeller, gear, heat_sink, crossed_holes, impeller_disc)
