#!/usr/bin/env python3
"""coarse_cad.py FOLDER: three coarse meshes of CAD geometry, orders 3 and 4, written as NAME_pP.msh.

A torus, two crossed pipes, and a bracket with fillets and bores, meshed by Gmsh so coarsely that boundary edges of one
tetrahedron lie in the surface's tangent plane: what `varimesh optimise --repair split` is for.
"""
import sys
from pathlib import Path

import gmsh
from coarse_parts import write_all


def torus(occ):
    occ.addTorus(0, 0, 0, 1, 0.35)
    return 0.45


def pipes(occ):
    outer = [(3, occ.addCylinder(-2, 0, 0, 4, 0, 0, 0.6))], [(3, occ.addCylinder(0, -2, 0, 0, 4, 0, 0.5))]
    inner = [(3, occ.addCylinder(-2, 0, 0, 4, 0, 0, 0.45)), (3, occ.addCylinder(0, -2, 0, 0, 4, 0, 0.35))]
    occ.cut(occ.fuse(*outer)[0], inner)
    return 0.45


def bracket(occ):
    plates = [(3, occ.addBox(0, 0, 0, 3, 1.5, 0.4))], [(3, occ.addBox(0, 0, 0, 0.4, 1.5, 2))]
    body = occ.fuse(*plates)[0]
    for edges_at, radius in (((0.4, None, 0.4), 0.5), ((3, None, None), 0.35)):
        occ.synchronize()
        chosen = []
        for _, edge in gmsh.model.getEntities(1):
            x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(1, edge)
            box = ((x0, x1), (y0, y1), (z0, z1))
            along = max(range(3), key=lambda axis: box[axis][1] - box[axis][0])
            wanted = 1 if edges_at[2] is not None else 2
            at_place = all(place is None or abs(sum(ends) / 2 - place) < 1e-5 for place, ends in zip(edges_at, box))
            if along == wanted and at_place:
                chosen.append(edge)
        body = occ.fillet([body[0][1]], chosen, [radius])
    bores = [(3, occ.addCylinder(2.1, 0.75, -1, 0, 0, 3, 0.45)), (3, occ.addCylinder(-1, 0.75, 1.4, 3, 0, 0, 0.4))]
    occ.cut(body, bores)
    return 1.2


write_all(Path(sys.argv[1]), (torus, pipes, bracket), (3, 4), 2)
