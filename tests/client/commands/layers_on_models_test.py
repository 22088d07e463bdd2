"""Boundary layers of hexahedra round a cylinder keep their heights when their mesh is curved and slides on its CAD model with
the default objective. Skipped, with a word, without Gmsh's Python module or without the plugin that reads CAD files."""
import math
import re
import subprocess
import sys
import unittest
from pathlib import Path

from bodies import certified
from geometry_test import distances, gmsh_python
from programs import VARIMESH, WithFolder, run

MODEL = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
occ.cut([(3, occ.addCylinder(0, 0, 0, 0, 0, 1, 3))], [(3, occ.addCylinder(0, 0, 0, 0, 0, 1, 1))])
occ.synchronize()
gmsh.write(sys.argv[1])
"""
COLUMNS, ROWS = 12, 2
# The wall is at radius 1. Layers begin with a height of 1e-3, and each is twice as high as the one below.
RADII = [1 + 1e-3 * (2**k - 1) for k in range(8)] + [1.5, 2.2, 3]
# Uneven, so that the straight sides bulge by different lengths.
ANGLES = [2 * math.pi / COLUMNS * (i + 0.2 * math.sin(3 * i)) for i in range(COLUMNS)]


VERTICES = COLUMNS * len(RADII) * (ROWS + 1)


def number(i, j, k):
    return (k * len(RADII) + j) * COLUMNS + i % COLUMNS + 1


def straight_mesh():
    """MSH 2.2. The boundary has one tag."""
    nodes = [f"{number(i, j, k)} {r * math.cos(a)} {r * math.sin(a)} {k / ROWS}"
             for k in range(ROWS + 1) for j, r in enumerate(RADII) for i, a in enumerate(ANGLES)]
    cells, sides = [], []
    for i in range(COLUMNS):
        for k in range(ROWS):
            for j in range(len(RADII) - 1):
                square = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
                cells.append([number(a, b, k) for a, b in square[::-1]] + [number(a, b, k + 1) for a, b in square[::-1]])
            for j in (0, len(RADII) - 1):
                sides.append([number(i, j, k), number(i + 1, j, k), number(i + 1, j, k + 1), number(i, j, k + 1)])
        for k in (0, ROWS):
            for j in range(len(RADII) - 1):
                sides.append([number(i, j, k), number(i, j + 1, k), number(i + 1, j + 1, k), number(i + 1, j, k)])
    elements = [f"3 2 1 1 {' '.join(map(str, side))}" for side in sides]
    elements += [f"5 2 2 2 {' '.join(map(str, cell))}" for cell in cells]
    elements = [f"{at} {element}" for at, element in enumerate(elements, 1)]
    return "\n".join(["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes)), *nodes, "$EndNodes", "$Elements",
                      str(len(elements)), *elements, "$EndElements", ""])


def places(text):
    """By number: the coordinates of a node in a file of MSH 2.2."""
    lines = text.splitlines()
    first = lines.index("$Nodes") + 2
    rows = (line.split() for line in lines[first:lines.index("$EndNodes")])
    return {int(row[0]): tuple(map(float, row[1:])) for row in rows}


def crowded(x, y):
    """The same point after the nodes of each column have moved along the wall towards one of its ends."""
    r, angle = math.hypot(x, y), math.atan2(y, x)
    angle += 2 * math.pi if angle < ANGLES[0] - 1e-9 else 0
    ends = ANGLES + [ANGLES[0] + 2 * math.pi]
    column = max(i for i in range(COLUMNS) if ends[i] <= angle + 1e-9)
    width = ends[column + 1] - ends[column]
    angle += 0.06 * width * math.sin(math.pi * (angle - ends[column]) / width)
    return r * math.cos(angle), r * math.sin(angle)


class LayersOnModels(WithFolder):
    def setUp(self):
        super().setUp()
        self.model, self.straight = self.folder / "ring.step", self.folder / "straight.msh"
        self.curved, self.out = self.folder / "curved.msh", self.folder / "out.msh"
        subprocess.run([PYTHON, "-c", MODEL, str(self.model)], check=True, capture_output=True)
        self.straight.write_text(straight_mesh())

    def read(self, mesh):
        text = self.folder / "text.msh"
        done = run("convert", mesh, text, "--format", "msh22")
        self.assertEqual(done.returncode, 0, done.stderr)
        return text.read_text()

    def check_heights(self, before, after):
        heights = [(math.hypot(*before[n][:2]) - 1, math.hypot(*after[n][:2]) - 1) for n in range(1, VERTICES + 1)]
        in_layers = [(a, b) for a, b in heights if 1e-6 < a < 0.2]
        self.assertEqual(len(in_layers), 7 * COLUMNS * (ROWS + 1))
        self.assertLess(max(abs(b / a - 1) for a, b in in_layers), 0.05)
        self.assertLess(max(abs(b) for a, b in heights if abs(a) < 1e-9), 1e-9)

    def test_they_keep_their_heights(self):
        for order in (2, 3):
            with self.subTest(order=order):
                done = run("curve", self.straight, "--geometry", self.model, "--order", order, "-o", self.curved)
                self.assertEqual(done.returncode, 0, done.stderr)
                count, valid = certified(done.stdout)
                self.assertEqual(count, valid)
                text = self.read(self.curved)
                self.check_heights(places(self.straight.read_text()), places(text))

                moved = {n: (*crowded(x, y), z) for n, (x, y, z) in places(text).items()}
                for n, x in moved.items():
                    text = re.sub(rf"(?m)^{n} \S+ \S+ \S+$", f"{n} {x[0]!r} {x[1]!r} {x[2]!r}", text, count=1)
                uneven = self.folder / "uneven.msh"
                uneven.write_text(text)
                done = run("optimise", uneven, "--geometry", self.model, "-o", self.out)
                self.assertEqual(done.returncode, 0, done.stderr)
                rms_before, rms_after, *_ = distances(done.stderr)
                self.assertLess(rms_after, 0.9 * rms_before)  # nodes of the other boundary slide
                self.check_heights(moved, places(self.read(self.out)))


if __name__ == "__main__":
    PYTHON = gmsh_python()
    if PYTHON is None or not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists():
        print("skipped: Gmsh's Python module or the plugin that reads CAD files is missing", file=sys.stderr)
        sys.exit(77)
    unittest.main(verbosity=2)
