"""Boundary nodes slide on a CAD model: a pipe with a step, which Gmsh makes and meshes. Skipped, with a word, without Gmsh's
Python module or without the plugin that reads CAD files."""
import json
import re
import subprocess
import sys
import unittest
from pathlib import Path

from programs import MESH, VARIMESH, WithFolder, run

MAKE = """
import sys, gmsh
folder = sys.argv[1]
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
occ.fuse([(3, occ.addCylinder(0, 0, 0, 0, 0, 2, 1))], [(3, occ.addCylinder(0, 0, 2, 0, 0, 1, 0.5))])
occ.synchronize()
gmsh.write(folder + "/part.brep")
gmsh.write(folder + "/part.step")
for key, value in {"Mesh.MeshSizeMax": 0.9, "Mesh.MeshSizeMin": 0.5, "Mesh.MshFileVersion": 4.1, "Mesh.SaveAll": 1,
                   "Mesh.HighOrderOptimize": 0}.items():
    gmsh.option.setNumber(key, value)
gmsh.model.mesh.generate(3)
gmsh.model.mesh.setOrder(3)
gmsh.write(folder + "/part.msh")
gmsh.option.setNumber("Mesh.SaveParametric", 1)
gmsh.write(folder + "/parameters.msh")
gmsh.option.setNumber("Mesh.SaveParametric", 0)
gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
gmsh.write(folder + "/part22.msh")
"""

# A torus so coarse that elements are left though all nodes have moved together.
TORUS = """
import sys, gmsh
folder = sys.argv[1]
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addTorus(0, 0, 0, 1, 0.35)
gmsh.model.occ.synchronize()
gmsh.write(folder + "/torus.brep")
for key, value in {"Mesh.MeshSizeMax": 0.776, "Mesh.MeshSizeMin": 0.194, "Mesh.SaveAll": 1, "Mesh.HighOrderOptimize": 0,
                   "Mesh.RandomSeed": 1, "General.NumThreads": 1}.items():
    gmsh.option.setNumber(key, value)
gmsh.model.mesh.generate(3)
gmsh.model.mesh.setOrder(2)
gmsh.write(folder + "/torus.msh")
"""


def gmsh_python():
    """A Python that has Gmsh's module, or None."""
    for python in (sys.executable, "/usr/bin/python3"):
        if subprocess.run([python, "-c", "import gmsh"], capture_output=True).returncode == 0:
            return python
    return None


def distances(text):
    """rms before, rms after, largest before, largest after."""
    found = re.search(r"rms (\S+) before, (\S+) after; largest (\S+) before, (\S+) after\.", text)
    return [float(number) for number in found.groups()]


class Geometry(WithFolder):
    def setUp(self):
        super().setUp()
        subprocess.run([PYTHON, "-c", MAKE, str(self.folder)], check=True, capture_output=True)
        self.out = self.folder / "out.msh"

    def slid(self, mesh, model, *more):
        done = run("optimise", self.folder / mesh, "--geometry", self.folder / model, "-o", self.out, *more)
        self.assertIn(done.returncode, (0, 4), done.stderr)  # 4: an element at the step may be left invalid
        return done.stderr

    def test_every_surface_matches_and_the_boundary_comes_nearer(self):
        for mesh in ("part.msh", "part22.msh"):
            for model in ("part.brep", "part.step"):
                text = self.slid(mesh, model)
                self.assertIn("5 of 5 surfaces of the mesh matched", text)
                self.assertNotIn("belong to no entity", text)
                rms_before, rms_after, largest_before, largest_after = distances(text)
                self.assertLess(rms_after, rms_before)
                self.assertLessEqual(largest_after, largest_before)

    def test_parameters_of_the_file_are_used_and_written_for_nodes_that_slid(self):
        used = re.compile(r"The parameters in the file lead to (\d+) of these nodes")
        before = used.search(self.slid("parameters.msh", "part.brep"))
        self.assertGreater(int(before[1]), 100)
        self.out.rename(self.folder / "slid.msh")
        text = self.slid("slid.msh", "part.brep", "--slide", "none")
        self.assertGreater(int(used.search(text)[1]), 100)
        self.assertNotIn("were projected", text)  # the parameters lead to all nodes, also those that slid
        self.assertIsNone(used.search(self.slid("part.msh", "part.brep")))

    def test_a_time_limit_that_passes_while_nodes_slide_leaves_them_and_gives_a_mesh(self):
        text = self.slid("part.msh", "part.step", "--time-limit", "0.01")
        self.assertIn("The time limit passed while boundary nodes slid, so they are where they came.", text)
        self.assertTrue(self.out.exists())

    def test_refining_goes_on_from_the_mesh_in_which_all_nodes_have_moved_together(self):
        subprocess.run([PYTHON, "-c", TORUS, str(self.folder)], check=True, capture_output=True)
        done = run("optimise", self.folder / "torus.msh", "--geometry", self.folder / "torus.brep", "--repair", "refine",
                   "-o", self.out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        before, after = (sum(document[when]["certified"][key] for key in ("valid", "invalid", "undecided"))
                         for when in ("before", "after"))
        self.assertEqual(document["after"]["certified"]["valid"], after)
        if "taken" in [trial["outcome"] for trial in document["slide_trials"]]:
            self.assertLess(after, 1.06 * before)  # 283 of 273; from the mesh as it slid first, 295

    def test_slide_none_moves_no_boundary_node(self):
        rms_before, rms_after, *_ = distances(self.slid("part.msh", "part.brep", "--slide", "none"))
        self.assertEqual(rms_before, rms_after)

    def hardly_valid(self):
        """A sound mesh, of which one node inside has moved until the smallest scaled Jacobian is between .002 and .018."""
        sound, mesh = self.folder / "sound.msh", self.folder / "hardly.msh"
        self.slid("part22.msh", "part.brep", "--repair", "split")
        self.assertEqual(run("convert", self.out, sound, "--format", "msh22").returncode, 0)
        lines = sound.read_text().splitlines()
        nodes, elements = lines.index("$Nodes") + 2, lines.index("$Elements") + 2
        on_surfaces, inside = set(), set()
        for line in lines[elements:lines.index("$EndElements")]:
            _, kind, tags, *rest = map(int, line.split())
            (inside if kind == 29 else on_surfaces).update(rest[tags:])  # 29: a tetrahedron of order 3
        moved = min(inside - on_surfaces)
        at = next(i for i in range(nodes, elements) if lines[i].split()[0] == str(moved))
        number, x, *others = lines[at].split()
        low, high = 0, 1
        for _ in range(40):
            middle = (low + high) / 2
            lines[at] = " ".join([number, repr(float(x) + middle), *others])
            mesh.write_text("\n".join(lines) + "\n")
            quality = json.loads(run("quality", mesh, "--json").stdout)["quality"]
            smallest = quality["min_scaled_jacobian"]
            if .002 < smallest < .018 and quality["invalid_elements"] == 0:
                return mesh
            low, high = (middle, high) if smallest > .01 else (low, middle)
        self.fail("no such mesh")

    def test_all_nodes_move_together_if_the_mesh_is_hardly_valid(self):
        mesh = self.hardly_valid()
        smallest = []
        for flags in ([], ["--slide", "all"]):
            done = run("optimise", mesh, "--geometry", self.folder / "part.brep", "-o", self.out, "--json",
                       "--max-iterations", 0, *flags)
            self.assertEqual(done.returncode, 0, done.stderr)
            smallest.append(json.loads(done.stdout)["after"]["min_scaled_jacobian"])
            said = re.search(r"The smallest scaled Jacobian is only \S+, so now all nodes move together", done.stderr)
            self.assertEqual(said is None, bool(flags), done.stderr)
        self.assertGreater(smallest[0], smallest[1])

    def test_what_cannot_be_used_gives_a_sentence_and_no_file(self):
        (self.folder / "cut.step").write_bytes((self.folder / "part.step").read_bytes()[:3000])
        for arguments, status, sentence in (
                ([self.folder / "part.msh", "--geometry", self.folder / "cut.step"], 3, "the STEP file is cut off"),
                ([self.folder / "part.msh", "--geometry", self.folder / "none.step"], 3, "is not a file"),
                ([MESH, "--geometry", self.folder / "part.step"], 3,
                 "No edge on the boundary of the mesh lies on a curve"),
                ([self.folder / "part.msh", "--geometry", self.folder / "part.step", "--order", "4"], 2, "--order"),
                ([self.folder / "part.msh", "--geometry", self.folder / "part.step", "--fix", "no"], 2, "'no'")):
            done = run("optimise", *arguments, "-o", self.out)
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertIn(sentence, done.stderr)
            self.assertFalse(self.out.exists())


if __name__ == "__main__":
    PYTHON = gmsh_python()
    plugin = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
    if PYTHON is None or not plugin.exists():
        print("skipped: there is no Python module gmsh, or VariMesh was built without OpenCASCADE")
        sys.exit(77)
    unittest.main(verbosity=2)
