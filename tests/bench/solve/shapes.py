"""Curved meshes that Gmsh makes of simple bodies: a cube less a ball, a square less a disc, a plate with a round hole, and an
annulus."""
import gmsh

HALF_WIDTH, RADIUS = 1.0, 0.5


def make(path, dimension, order, size, *, quadrilaterals=False, layers=0, radius=RADIUS, straight=False):
    """Writes a mesh of tetrahedra, or of triangles or quadrilaterals, and with `layers` the same number of layers of prisms
    or hexahedra above each of these. Gmsh does not optimise it: only the elements on the ball or the hole are curved. With
    `straight` no element is curved, and the body is a polyhedron."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if dimension == 3:
        whole = gmsh.model.occ.addBox(-HALF_WIDTH, -HALF_WIDTH, -HALF_WIDTH, 2 * HALF_WIDTH, 2 * HALF_WIDTH, 2 * HALF_WIDTH)
        hole = gmsh.model.occ.addSphere(0, 0, 0, radius)
    else:
        whole = gmsh.model.occ.addRectangle(-HALF_WIDTH, -HALF_WIDTH, 0, 2 * HALF_WIDTH, 2 * HALF_WIDTH)
        hole = gmsh.model.occ.addDisk(0, 0, 0, radius, radius)
    body = gmsh.model.occ.cut([(dimension, whole)], [(dimension, hole)])[0]
    if layers:
        gmsh.model.occ.extrude(body, 0, 0, HALF_WIDTH / 2, [layers], recombine=True)
    gmsh.model.occ.synchronize()
    for name, value in {"MeshSizeMin": size, "MeshSizeMax": size, "ElementOrder": order, "HighOrderOptimize": 0,
                        "SecondOrderLinear": int(straight), "RecombineAll": int(quadrilaterals),
                        "SubdivisionAlgorithm": int(quadrilaterals)}.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.model.mesh.generate(gmsh.model.getDimension())
    gmsh.write(str(path))
    gmsh.finalize()


def make_annulus(path, order, around, across):
    """Writes a mesh of around × across quadrilaterals between circles of the radii .5 and 2, in four blocks, which become
    larger outwards, as annulus_p3.msh of tests/cases does with 16 × 8."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ, mesh, centre = gmsh.model.occ, gmsh.model.mesh, gmsh.model.occ.addPoint(0, 0, 0)
    corners = [[occ.addPoint(radius * x, radius * y, 0) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))] for radius in (0.5, 2.0)]
    inner, outer = ([occ.addCircleArc(a, centre, b) for a, b in zip(ring, ring[1:] + ring[:1])] for ring in corners)
    spokes = [occ.addLine(a, b) for a, b in zip(*corners)]
    for i in range(4):
        occ.addPlaneSurface([occ.addCurveLoop([inner[i], spokes[(i + 1) % 4], outer[i], spokes[i]])])
    occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        if gmsh.model.getType(1, curve) == "Line":
            mesh.setTransfiniteCurve(curve, across + 1, "Progression", 1.3 ** (8 / across))
        else:
            mesh.setTransfiniteCurve(curve, around // 4 + 1)
    for _, block in gmsh.model.getEntities(2):
        mesh.setTransfiniteSurface(block)
        mesh.setRecombine(2, block)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 0)
    mesh.generate(2)
    gmsh.write(str(path))
    gmsh.finalize()
