"""Curved meshes that Gmsh makes of two simple bodies: a cube less a ball, and a square less a disc."""
import gmsh

HALF_WIDTH, RADIUS = 1.0, 0.5


def make(path, dimension, order, size, *, quadrilaterals=False, straight=False):
    """Writes a mesh of tetrahedra, or of triangles or quadrilaterals. Gmsh does not optimise it: only the elements on the
    ball are curved. With `straight` no element is curved, and the body is a polyhedron."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if dimension == 3:
        whole = gmsh.model.occ.addBox(-HALF_WIDTH, -HALF_WIDTH, -HALF_WIDTH, 2 * HALF_WIDTH, 2 * HALF_WIDTH, 2 * HALF_WIDTH)
        hole = gmsh.model.occ.addSphere(0, 0, 0, RADIUS)
    else:
        whole = gmsh.model.occ.addRectangle(-HALF_WIDTH, -HALF_WIDTH, 0, 2 * HALF_WIDTH, 2 * HALF_WIDTH)
        hole = gmsh.model.occ.addDisk(0, 0, 0, RADIUS, RADIUS)
    gmsh.model.occ.cut([(dimension, whole)], [(dimension, hole)])
    gmsh.model.occ.synchronize()
    for name, value in {"MeshSizeMin": size, "MeshSizeMax": size, "ElementOrder": order, "HighOrderOptimize": 0,
                        "SecondOrderLinear": int(straight), "RecombineAll": int(quadrilaterals),
                        "SubdivisionAlgorithm": int(quadrilaterals)}.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.model.mesh.generate(dimension)
    gmsh.write(str(path))
    gmsh.finalize()
