"""Plane meshes and their CAD profiles: aerofoils with layers, from one command. Skipped, with a word, without Gmsh's Python
module or without the plugin that reads CAD files."""
import json
import math
import subprocess
import sys
import unittest
from pathlib import Path

from bodies import certified
from geometry_test import distances, gmsh_python
from programs import VARIMESH, WithFolder, run

# An aerofoil of four digits in a circle, and a straight mesh around it with layers at the wall. `what` is what the model
# has: a face, or only its edges.
FOIL = """
import sys, math, gmsh
model, mesh, digits, end, what, quads = sys.argv[1:]
m, p, t, blunt = int(digits[0]) / 100, int(digits[1]) / 10, int(digits[2:]) / 100, end == "blunt"
def point(x, side):
    y = 5 * t * (.2969 * math.sqrt(x) - .126 * x - .3516 * x**2 + .2843 * x**3 - (.1015 if blunt else .1036) * x**4)
    c = d = 0
    if m:
        c = m / p**2 * (2 * p * x - x * x) if x < p else m / (1 - p)**2 * (1 - 2 * p + 2 * p * x - x * x)
        d = 2 * m * (p - x) / (p**2 if x < p else (1 - p)**2)
    a = math.atan(d)
    y = 0 if x == 1 and not blunt else y
    return x - side * y * math.sin(a), c + side * y * math.cos(a), 0
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
n = 40
xs = [.5 * (1 - math.cos(math.pi * i / n)) for i in range(1, n)]
nose = occ.addPoint(0, 0, 0)
ends = [occ.addPoint(*point(1, side)) for side in ((1, -1) if blunt else (1,))]
wall = [occ.addSpline([nose] + [occ.addPoint(*point(x, 1)) for x in xs] + [ends[0]]),
        occ.addSpline([nose] + [occ.addPoint(*point(x, -1)) for x in xs] + [ends[-1]])]
if blunt: wall.append(occ.addLine(*ends))
foil = occ.addCurveLoop([wall[0]] + wall[2:] + [-wall[1]])
far = occ.addCircle(.5, 0, 0, 3)
occ.synchronize()
if what == "edges": gmsh.write(model)
occ.addPlaneSurface([occ.addCurveLoop([far]), foil])
occ.synchronize()
if what == "face": gmsh.write(model)
field = gmsh.model.mesh.field
layers = field.add("BoundaryLayer")
field.setNumbers(layers, "CurvesList", wall)
field.setNumbers(layers, "FanPointsList", ends)
for key, value in {"Size": 5e-4, "Ratio": 1.5, "Thickness": .02, "Quads": int(quads == "quads")}.items():
    field.setNumber(layers, key, value)
field.setAsBoundaryLayer(layers)
for curve in wall[:2]: gmsh.model.mesh.setTransfiniteCurve(curve, 37, "Bump", .2)
gmsh.option.setNumber("Mesh.MeshSizeMax", .8)
gmsh.option.setNumber("Mesh.SaveAll", 1)
gmsh.model.mesh.generate(2)
gmsh.write(mesh)
"""

# By mesh, the distances of nodes from the wall: of all vertices of the first mesh, in both.
DISTANCES = """
import json, sys, gmsh, numpy
model, *meshes = sys.argv[1:]
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
places = []
for mesh in meshes:
    gmsh.open(mesh)
    numbers, x, _ = gmsh.model.mesh.getNodes()
    places.append(dict(zip(map(int, numbers), numpy.reshape(x, (-1, 3)))))
    gmsh.clear()
gmsh.model.occ.importShapes(model, False)
gmsh.model.occ.synchronize()
wall = [tag for dim, tag in gmsh.model.getEntities(1) if gmsh.model.getBoundingBox(dim, tag)[3] < 1.5]
numbers = [number for number in places[0] if number in places[1]]
result = []
for of in places:
    x = numpy.array([of[number] for number in numbers])
    feet = [numpy.reshape(gmsh.model.getClosestPoint(1, tag, numpy.ravel(x))[0], (-1, 3)) for tag in wall]
    result.append(numpy.min([numpy.linalg.norm(foot - x, axis=1) for foot in feet], axis=0).tolist())
print(json.dumps(result))
"""

# The lift coefficients at four degrees of the aerofoil 0012 by its formula and of the wall of a mesh: potential flow, with a
# source on each straight panel, one vortex strength for all, and equal speeds at the trailing edge (Hess and Smith).
LIFT = """
import sys, math, gmsh, numpy as np
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[1])
tags, places, _ = gmsh.model.mesh.getNodes()
place = dict(zip(tags, places.reshape(-1, 3)))
sides = []
for _, curve in gmsh.model.getEntities(1):
    if gmsh.model.getBoundingBox(1, curve)[3] > 1.5: continue
    (kind,), _, (nodes,) = gmsh.model.mesh.getElements(1, curve)
    count = gmsh.model.mesh.getElementProperties(kind)[3]
    at = [number for i in range(5) for number in (i / 2.5 - 1, 0, 0)] + [1, 0, 0]
    values = gmsh.model.mesh.getBasisFunctions(kind, at, "Lagrange")[1].reshape(-1, count)
    points = values @ np.array([[place[node] for node in edge] for edge in nodes.reshape(-1, count)])
    side = np.unique(points.reshape(-1, 3)[:, :2].round(12), axis=0)
    sides.append(side[np.argsort(side[:, 0])])
upper, lower = sorted(sides, key=lambda side: -side[:, 1].mean())
# From the trailing edge below to the nose and back above.
wall = np.concatenate([lower[::-1], upper[1:]])
x = .5 * (1 - np.cos(np.linspace(0, math.pi, 120)))
y = .6 * (.2969 * np.sqrt(x) - .126 * x - .3516 * x**2 + .2843 * x**3 - .1036 * x**4)
y[-1] = 0
exact = np.concatenate([np.stack([x, -y], 1)[::-1], np.stack([x, y], 1)[1:]])
def lift(points, alpha=math.radians(4)):
    start, along = points[:-1], np.diff(points, axis=0)
    length = np.linalg.norm(along, axis=1)
    t = along / length[:, None]
    n = np.stack([-t[:, 1], t[:, 0]], 1)
    off = (start + along / 2)[:, None] - start[None]
    u, v = np.einsum("ijk,jk->ij", off, t), np.einsum("ijk,jk->ij", off, n)
    log = -.5 * np.log(((u - length)**2 + v**2) / (u**2 + v**2))
    turn = np.arctan2(v, u - length) - np.arctan2(v, u)
    np.fill_diagonal(turn, math.pi)
    source = (log[..., None] * t + turn[..., None] * n) / (2 * math.pi)
    vortex = (turn[..., None] * t - log[..., None] * n) / (2 * math.pi)
    stream, count = np.array([math.cos(alpha), math.sin(alpha)]), len(length)
    matrix, right = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    matrix[:-1, :-1] = np.einsum("ijk,ik->ij", source, n)
    matrix[:-1, -1] = np.einsum("ijk,ik->i", vortex, n)
    right[:-1] = -n @ stream
    for i in (0, -1):
        matrix[-1, :-1] += source[i] @ t[i]
        matrix[-1, -1] += (vortex[i] @ t[i]).sum()
        right[-1] -= t[i] @ stream
    return 2 * abs(np.linalg.solve(matrix, right)[-1]) * length.sum()
print(lift(exact), lift(wall), len(wall))
"""

# Digits, trailing edge, format of the model, what it has, and the elements of the layers.
FOILS = [("0012", "sharp", "step", "edges", "quads"), ("0012", "blunt", "step", "edges", "triangles"),
         ("2412", "sharp", "brep", "face", "quads"), ("2412", "blunt", "step", "face", "triangles"),
         ("4415", "sharp", "step", "face", "triangles"), ("4415", "blunt", "brep", "edges", "quads")]

TURNED_DISC = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
occ.cut([(2, occ.addDisk(0, 0, 0, 2, 1))], [(2, occ.addDisk(.3, 0, 0, .4, .4))])
occ.rotate(occ.getEntities(2), 0, 0, 0, 1, 2, 3, float(sys.argv[2]))
occ.synchronize()
gmsh.write(sys.argv[1])
"""

DISC = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
gmsh.model.occ.synchronize()
gmsh.write(sys.argv[1])
"""


def python(script, *arguments):
    return subprocess.run([PYTHON, "-c", script, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


class Profile(WithFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.msh"

    def test_aerofoils_with_layers_are_curved_by_one_command(self):
        straight = self.folder / "straight.msh"
        for number, (digits, end, ending, what, elements) in enumerate(FOILS):
            model = self.folder / f"foil.{ending}"
            python(FOIL, model, straight, digits, end, what, elements)
            for order in ((2, 4), (3, 5))[number // 2 % 2]:
                with self.subTest(foil=digits, end=end, order=order):
                    done = run("curve", straight, "--geometry", model, "--order", order, "-o", self.out)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    count, valid = certified(done.stdout)
                    self.assertEqual(count, valid)
                    rms_before, rms_after, *_ = distances(done.stderr)
                    self.assertLessEqual(rms_after, 1.005 * rms_before)  # they are printed with three digits
                    before, after = map(list, json.loads(python(DISTANCES, model, straight, self.out)))
                    heights = [(a, b) for a, b in zip(before, after) if 1e-6 < a < 0.01]
                    self.assertGreater(len(heights), 100)
                    for a, b in heights:
                        self.assertLess(abs(b / a - 1), 0.05)
                    self.assertLess(max(b for a, b in zip(before, after) if a <= 1e-9), 1e-9)

    def test_the_lift_of_an_aerofoil_is_that_of_its_formula(self):
        model, straight = self.folder / "foil.step", self.folder / "straight.msh"
        python(FOIL, model, straight, "0012", "sharp", "edges", "quads")
        for order in (2, 3, 4, 5):
            done = run("curve", straight, "--geometry", model, "--order", order, "-o", self.out)
            self.assertEqual(done.returncode, 0, done.stderr)
            exact, lift, points = map(float, python(LIFT, self.out).split())
            self.assertGreater(points, 100)
            self.assertAlmostEqual(exact, 0.482, delta=0.005)  # 2 pi sin(4 degrees) (1 + .77 * .12) = .479
            self.assertLess(abs(lift / exact - 1), 0.01, order)

    def test_a_planar_face_is_meshed_in_any_plane(self):
        for angle in (0, 0.7):
            model = self.folder / "disc.step"
            python(TURNED_DISC, model, angle)
            done = run("mesh", model, "--size", 0.4, "--per-turn", 12, "--order", 3, "-o", self.out)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("2-D mesh of order 3", done.stdout)
            self.assertNotIn("stay", done.stderr)
            count, valid = certified(done.stdout)
            self.assertEqual(count, valid)
            self.assertLess(distances(done.stderr)[3], 1e-3)
            slid = self.folder / "slid.msh"
            done = run("optimise", self.out, "--geometry", model, "-o", slid)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("2 curves lie in the plane of the mesh", done.stderr)

    def test_a_triangle_with_two_edges_on_a_circle_is_refined(self):
        # A disc of nine straight edges. One triangle has two of them, which meet at 180 degrees when they are curved.
        places = [(math.cos(math.tau * i / 9), math.sin(math.tau * i / 9)) for i in range(9)] + [(0, 0)]
        cells = [(1, 2, 3), (10, 1, 3)] + [(10, i, i % 9 + 1) for i in range(3, 10)]
        mesh, model = self.folder / "disc.msh", self.folder / "disc.brep"
        mesh.write_text("\n".join(
            ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", "10", *(f"{k} {x} {y} 0" for k, (x, y) in enumerate(places, 1)),
             "$EndNodes", "$Elements", "18", *(f"{i} 1 2 1 1 {i} {i % 9 + 1}" for i in range(1, 10)),
             *(f"{k} 2 2 2 1 {a} {b} {c}" for k, (a, b, c) in enumerate(cells, 10)), "$EndElements", ""]))
        python(DISC, model)
        for order in (3, 4):
            self.out.unlink(missing_ok=True)
            done = run("curve", mesh, "--geometry", model, "--order", order, "-o", self.out)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("Refining split 1 edge of the model; the mesh has 2 more elements than the 9", done.stderr)
            count, valid = certified(done.stdout)
            self.assertEqual((count, valid), (11, 11))
        done = run("curve", mesh, "--geometry", model, "--order", 3, "--repair", "refine", "--refine-growth", 1.1, "-o", self.out)
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertIn("the mesh may have at most 9 elements", done.stderr)

    def test_a_profile_of_another_plane_is_refused(self):
        flat, turned = self.folder / "flat.step", self.folder / "turned.step"
        python(TURNED_DISC, flat, 0)
        python(TURNED_DISC, turned, 0.7)
        self.assertEqual(run("mesh", flat, "--size", 0.4, "--order", 2, "-o", self.out).returncode, 0)
        done = run("optimise", self.out, "--geometry", turned, "-o", self.folder / "slid.msh")
        self.assertEqual(done.returncode, 3)
        self.assertIn("No curve of the geometry lies in the plane of the mesh", done.stderr)


if __name__ == "__main__":
    PYTHON = gmsh_python()
    if PYTHON is None or not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists():
        print("skipped: there is no Python module gmsh, or VariMesh was built without OpenCASCADE")
        sys.exit(77)
    unittest.main(verbosity=2)
