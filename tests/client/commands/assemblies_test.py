"""Assemblies of two to five bodies become one mesh each. Skipped, with a word, without the program gmsh, its Python module,
or the plugin that reads CAD files."""
import json
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

from bodies import certified
from geometry_test import gmsh_python
from programs import VARIMESH, WithFolder, run

# By name: the bodies. A bar between two cuts the second out of the first.
ASSEMBLIES = {
    "boxes": ["Box(0,0,0, 1,1,1)", "Box(0,0,1, 1,1,1)"],
    "a small box on a large one": ["Box(0,0,0, 2,2,1)", "Box(.5,.5,1, 1,1,1)"],
    "a corner": ["Box(0,0,0, 1,1,1)", "Box(1,1,0, 1,1,1)", "Box(0,1,0, 1,1,1)"],
    "a stack": ["Cylinder(0,0,0, 0,0,1, 1)", "Cylinder(0,0,1, 0,0,1, 1)", "Cylinder(0,0,2, 0,0,1, .6)"],
    "a pin in a plate": ["Box(-2,-2,0, 4,4,1)|Cylinder(0,0,0, 0,0,1, .8)", "Cylinder(0,0,0, 0,0,1, .8)"],
    "a bar on a plate": ["Box(-2,-2,0, 4,4,.5)", "Cylinder(0,0,.5, 0,0,1, 1)"],
    "rings": ["Cylinder(0,0,0, 0,0,1, 2)|Cylinder(0,0,0, 0,0,1, 1)", "Cylinder(0,0,0, 0,0,1, 3)|Cylinder(0,0,0, 0,0,1, 2)",
              "Cylinder(0,0,0, 0,0,1, 1)"],
    "a ball in a box": ["Box(-2,-2,-2, 4,4,4)|Sphere(0,0,0, 1)", "Sphere(0,0,0, 1)"],
    "five boxes": ["Box(0,0,0, 1,1,1)", "Box(1,0,0, 1,1,1)", "Box(0,1,0, 1,1,1)", "Box(1,1,0, 1,1,1)",
                   "Box(.5,.5,1, 1,1,1)"],
    "bodies that cross": ["Box(0,0,0, 3,2,1)", "Cylinder(1.5,1,.5, 0,0,2, .6)"],
    "a cone between cylinders": ["Cone(0,0,0, 0,0,1, 1.2,.7)", "Cylinder(0,0,1, 0,0,1, .7)", "Cylinder(0,0,-1, 0,0,1, 1.2)"],
}

MAKE = """
import json, sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
bodies = []
for text in json.loads(sys.argv[2]):
    parts = [[(3, eval("occ.add" + part))] for part in text.split("|")]
    bodies += parts[0] if len(parts) == 1 else occ.cut(*parts)[0]
if sys.argv[3] == "fused": occ.fragment(bodies[:1], bodies[1:])
occ.synchronize()
gmsh.write(sys.argv[1])
"""

# How many outer facets of tetrahedra are there twice, and the largest distance of a node of a surface from the model.
CHECK = """
import json, sys, gmsh, numpy
from collections import Counter
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[2])
numbers, x, _ = gmsh.model.mesh.getNodes()
place = dict(zip(map(int, numbers), numpy.reshape(x, (-1, 3))))
on_surfaces = sorted({int(n) for _, s in gmsh.model.getEntities(2) for e in gmsh.model.mesh.getElements(2, s)[2] for n in e})
facets = Counter()
for _, volume in gmsh.model.getEntities(3):
    for kind, _, nodes in zip(*gmsh.model.mesh.getElements(3, volume)):
        for cell in numpy.reshape(nodes, (-1, gmsh.model.mesh.getElementProperties(kind)[3]))[:, :4]:
            for without in range(4):
                facets[tuple(sorted(int(n) for k, n in enumerate(cell) if k != without))] += 1
outer = Counter(tuple(sorted(tuple(numpy.round(place[n], 7)) for n in f)) for f, count in facets.items() if count == 1)
x = numpy.array([place[n] for n in on_surfaces])
gmsh.clear()
gmsh.model.occ.importShapes(sys.argv[1])
gmsh.model.occ.synchronize()
feet = [gmsh.model.getClosestPoint(2, tag, x.ravel())[0].reshape(-1, 3) for _, tag in gmsh.model.getEntities(2)]
off = numpy.min([numpy.linalg.norm(foot - x, axis=1) for foot in feet], axis=0).max()
print(json.dumps([sum(count > 1 for count in outer.values()), float(off)]))
"""


LOOSE = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
occ.addBox(0, 0, 0, 2, 2, 1)
occ.addDisk(1, 1, 1, .6, .6)
occ.synchronize()
gmsh.write(sys.argv[1])
"""

# How many triangles lie where another one does.
TWICE = """
import sys, gmsh, numpy
from collections import Counter
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[1])
numbers, x, _ = gmsh.model.mesh.getNodes()
place = dict(zip(map(int, numbers), map(tuple, numpy.round(numpy.reshape(x, (-1, 3)), 7))))
seen = Counter(tuple(sorted(place[int(n)] for n in element[:3])) for kind, _, nodes in zip(*gmsh.model.mesh.getElements(2))
               for element in numpy.reshape(nodes, (-1, gmsh.model.mesh.getElementProperties(kind)[3])))
print(sum(count > 1 for count in seen.values()))
"""


class Assemblies(WithFolder):
    def test_bodies_get_one_certified_mesh_on_the_model(self):
        out = self.folder / "out.msh"
        for number, (name, bodies) in enumerate(ASSEMBLIES.items()):
            with self.subTest(assembly=name):
                model = self.folder / ("model." + ("step", "brep")[number % 2])
                subprocess.run([PYTHON, "-c", MAKE, str(model), json.dumps(bodies),
                                ("fused", "as they are")[number // 2 % 2]], check=True, capture_output=True)
                done = run("mesh", model, "--size", 0.8, "--per-turn", 10, "--order", 3, "--repair", "split",
                           "--threads", 1, "-o", out)
                self.assertEqual(done.returncode, 0, done.stderr)
                count, valid = certified(done.stdout)
                self.assertGreaterEqual(valid, count)
                self.assertNotIn("it is not sure where they belong", done.stderr)
                self.assertNotIn("belong to no entity", done.stderr)
                checked = subprocess.run([PYTHON, "-c", CHECK, str(model), str(out)], check=True, capture_output=True)
                doubled, off = json.loads(checked.stdout)
                self.assertEqual(doubled, 0)
                self.assertLess(off, 1e-9)

    def test_a_face_that_lies_on_a_body_is_part_of_its_side(self):
        # Whoever sweeps a face to a body often leaves the face in the file.
        model, out = self.folder / "model.step", self.folder / "out.msh"
        subprocess.run([PYTHON, "-c", LOOSE, str(model)], check=True, capture_output=True)
        done = run("mesh", model, "--size", 0.8, "--per-turn", 10, "--order", 3, "--threads", 1, "-o", out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        elements = subprocess.run([PYTHON, "-c", TWICE, str(out)], check=True, capture_output=True, text=True)
        self.assertEqual(int(elements.stdout), 0)


if __name__ == "__main__":
    PYTHON = gmsh_python()
    if PYTHON is None or not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists() or not shutil.which("gmsh"):
        print("skipped: there is no program or Python module gmsh, or VariMesh was built without OpenCASCADE")
        sys.exit(77)
    unittest.main(verbosity=2)
