"""Curved meshes that Gmsh makes of simple bodies: a cube less a ball, a square less a disc, and a plate with a round hole."""
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
