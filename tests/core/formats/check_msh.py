#!/usr/bin/python3
"""check_msh.py FOLDER: checks that Gmsh opens every SHAPE_ORDER_FORMAT.msh in the folder and sees one_cell() of samples.h.
peers_test.cpp runs it.

The cell must be element 7 in group 5, "the cell", with nodes numbered 2, 5, 8, …, which lie where the map puts Gmsh's own
reference nodes.
"""
import glob
import os
import sys

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
files = sorted(glob.glob(os.path.join(sys.argv[1], "*.msh")))
assert files
for path in files:
    shape, order, _ = os.path.basename(path)[:-4].split("_")
    order = int(order)
    gmsh.clear()
    gmsh.logger.start()
    gmsh.open(path)
    complaints = [line for line in gmsh.logger.get() if not line.startswith(("Info", "Progress"))]
    gmsh.logger.stop()
    assert not complaints, "%s: %s" % (path, complaints)
    dim = 2 if shape in ("triangle", "quadrilateral") else 3
    types, numbers, nodes = gmsh.model.mesh.getElements(dim)
    assert len(types) == 1 and list(numbers[0]) == [7], path
    count = len(nodes[0])
    try:
        name, _, got_order, _, local, _ = gmsh.model.mesh.getElementProperties(types[0])
    except Exception:
        # Gmsh 4.8 reads prisms above order 2 but has no basis for them, so only numbers and groups can be checked.
        assert shape == "prism" and order > 2, path
        local = None
    else:
        assert name.lower().startswith(shape[:5]) and got_order == order, (path, name)
    assert list(nodes[0]) == [3 * i + 2 for i in range(count)], path
    assert gmsh.model.getPhysicalName(dim, 5) == "the cell", path
    for i, node in enumerate(nodes[0] if local is not None else []):
        u = [local[dim * i + k] for k in range(dim)] + [0.0] * (3 - dim)
        # Gmsh's simplices go from 0 to 1, and so do a prism's triangle and a pyramid's height.
        if shape in ("triangle", "tetrahedron"):
            u[:dim] = [2 * v - 1 for v in u[:dim]]
        elif shape == "prism":
            u[:2] = [2 * v - 1 for v in u[:2]]
        elif shape == "pyramid":
            u[2] = 2 * u[2] - 1
        x, y, z = u
        if dim == 2:
            wanted = (x + 0.2 * y**order, y + 0.1 * x**order, 0.0)
        else:
            wanted = (x + 0.2 * y**order, y + 0.1 * z**order, z + 0.15 * x**order)
        got = gmsh.model.mesh.getNode(node)[0]
        assert max(abs(a - b) for a, b in zip(got, wanted)) < 1e-12, (path, i, list(got), wanted)
gmsh.finalize()
