"""Boundary nodes slide without a CAD model: on the boundary of the mesh as it came. The bracket has a boundary face that is
folded over. With its model beside it, sliding on the model is tested too, if the plugin that reads CAD files is there."""
import json
import re
import unittest
from pathlib import Path

from programs import CASES, MESH, VARIMESH, WithFolder, run

BRACKET, MODEL = CASES / "geometry" / "bracket_p3.msh", CASES / "geometry" / "bracket.brep"


def uncertified(document, when):
    certified = document[when]["certified"]
    return certified["invalid"] + certified["undecided"]


class SlideOn(WithFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.msh"

    def optimised(self, *flags, mesh=BRACKET):
        done = run("optimise", mesh, "-o", self.out, "--json", "--threads", 1, *flags)
        self.assertIn(done.returncode, (0, 4), done.stderr)
        return json.loads(done.stdout), done.stderr

    def folded(self, text):
        found = re.search(r"folded surface elements: (\d+) before, (\d+) after", text)
        return int(found[1]), int(found[2])

    def test_it_unfolds_what_a_fixed_boundary_cannot(self):
        fixed, _ = self.optimised()
        self.assertEqual(uncertified(fixed, "after"), 1)
        slid, text = self.optimised("--slide-on", "boundary")
        self.assertEqual(self.folded(text), (1, 0))
        self.assertGreater(slid["after"]["min_scaled_jacobian"], fixed["after"]["min_scaled_jacobian"])
        self.assertRegex(text, r"has \d+ surfaces, \d+ curves and \d+ vertices")

    def test_so_does_the_model(self):
        if not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists():
            self.skipTest("VariMesh was built without OpenCASCADE")
        slid, text = self.optimised("--geometry", MODEL)
        self.assertEqual(self.folded(text), (1, 0))
        self.assertEqual(uncertified(slid, "after"), 0)

    def test_the_quality_is_never_lower_than_with_a_fixed_boundary(self):
        for name in ("sphere_p3.msh", "solid_ball_p3.msh", "cylinder_p2.msh"):
            with self.subTest(mesh=name):
                fixed, _ = self.optimised(mesh=CASES / name)
                slid, text = self.optimised("--slide-on", "boundary", mesh=CASES / name)
                self.assertIn("without sliding", text)
                self.assertGreaterEqual(slid["after"]["min_scaled_jacobian"], fixed["after"]["min_scaled_jacobian"])

    def test_flags_that_do_not_go_together_are_refused(self):
        for flags, word in ((("--slide-on", "boundary", "--geometry", MODEL), "excludes"),
                            (("--slide-on", "boundary", "--snap"), "--snap"),
                            (("--slide", "all"), "--geometry or --slide-on"),
                            (("--slide-on", "boundary", "--order", 4), "--order"),
                            (("--slide-on", "model"), "boundary")):
            done = run("optimise", BRACKET, "-o", self.out, *flags)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(word, done.stderr)
            self.assertFalse(self.out.exists())

    def test_a_plane_mesh_is_refused(self):
        done = run("optimise", MESH, "-o", self.out, "--slide-on", "boundary")
        self.assertEqual(done.returncode, 3)
        self.assertIn("lies in a plane", done.stderr)
        self.assertFalse(self.out.exists())


class SurfacesAlone(WithFolder):
    """The boundary of the bracket without its volume."""

    def setUp(self):
        super().setUp()
        text, self.mesh, self.out = self.folder / "text.msh", self.folder / "surface.msh", self.folder / "out.msh"
        done = run("convert", BRACKET, text, "--format", "msh22")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = text.read_text().splitlines()
        at = lines.index("$Elements")
        kept = [line for line in lines[at + 2:lines.index("$EndElements")] if line.split()[1] == "21"]
        self.mesh.write_text("\n".join([*lines[:at + 1], str(len(kept)), *kept, "$EndElements"]) + "\n")

    def test_they_slide_and_are_certified(self):
        before = json.loads(run("quality", self.mesh, "--json").stdout)
        self.assertEqual(uncertified(before, "quality"), 1)
        for flags in (["--slide-on", "boundary"], ["--geometry", MODEL]):
            if "--geometry" in flags and not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists():
                continue
            done = run("optimise", self.mesh, "-o", self.out, "--json", *flags)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(uncertified(json.loads(done.stdout), "quality"), 0)
            self.assertEqual(run("quality", self.out, "--certify").returncode, 0)
            self.out.unlink()

    def test_there_is_no_job(self):
        done = run("optimise", self.mesh, "-o", self.out, "--slide-on", "boundary", "--history", self.folder / "history.csv")
        self.assertEqual(done.returncode, 2)
        self.assertIn("--history", done.stderr)
        self.assertFalse(self.out.exists())
        done = run("optimise", self.mesh, BRACKET, "--into", self.folder / "into", "--slide-on", "boundary")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("surface.msh' is a surface in space", done.stderr)
        self.assertIn("-o in place of --into", done.stderr)
        self.assertEqual([path.name for path in (self.folder / "into").iterdir()], [BRACKET.name])


if __name__ == "__main__":
    unittest.main(verbosity=2)
