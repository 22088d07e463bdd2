"""The same job gives the same bytes by the command with a server and without, by Python, by libvarimesh-client and by the
numerical library itself: without a geometry, on the mesh's own boundary, and on a CAD model."""
import os
import subprocess
import unittest
from pathlib import Path
from unittest import mock

import support

support.need()

from support import CASES, MESH, VARIMESH

import varimesh

SAME_BYTES = os.environ["VARIMESH_SAME_BYTES"]
PLUGIN = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
BRACKET, MODEL = CASES / "geometry" / "bracket_p3.msh", CASES / "geometry" / "bracket.brep"


class SameBytes(support.WithServer):
    def results(self, mesh, geometry):
        """The bytes of the result by each way. `geometry`: "none", "boundary" or a path."""
        flags = {"none": [], "boundary": ["--slide-on", "boundary"]}.get(geometry, ["--geometry", geometry])
        model = {"none": None, "boundary": varimesh.Geometry(slide_on="boundary")}.get(geometry, geometry)
        ways = {"command": [VARIMESH, "optimise", mesh, "--quiet", *flags, "-o"],
                "command with a server": [VARIMESH, "optimise", mesh, "--quiet", *flags, "--server", self.server.address, "-o"],
                "client": [SAME_BYTES, self.server.address, mesh, geometry],
                "library": [SAME_BYTES, "library", mesh, geometry]}
        results = {}
        for name, command in ways.items():
            out = self.folder / (name + mesh.suffix)
            done = subprocess.run([*command, out], capture_output=True, text=True)
            self.assertIn(done.returncode, (0, 4), (name, done.stderr))
            results[name] = out.read_bytes()
        out = self.folder / ("python" + mesh.suffix)
        self.client.optimise(mesh, out, geometry=model)
        return {**results, "python": out.read_bytes()}

    def check(self, mesh, geometry):
        results = self.results(mesh, geometry)
        first = results["command"]
        self.assertNotEqual(first, mesh.read_bytes())
        self.assertEqual({name for name, one in results.items() if one != first}, set())
        return first

    def test_without_a_geometry(self):
        self.check(MESH, "none")

    def test_on_the_own_boundary(self):
        # On the bracket the slid boundary is better, and on the cylinder that which came.
        for mesh in (BRACKET, CASES / "cylinder_p2.msh"):
            with self.subTest(mesh=mesh.name):
                self.check(mesh, "boundary")

    @unittest.skipUnless(PLUGIN.exists(), "VariMesh was built without OpenCASCADE")
    def test_on_a_model(self):
        text = self.folder / "text.msh"
        subprocess.run([VARIMESH, "convert", BRACKET, text, "--format", "msh22"], check=True, capture_output=True)
        for mesh in (BRACKET, text):
            with self.subTest(mesh=mesh.name):
                self.check(mesh, MODEL)

    @unittest.skipUnless(PLUGIN.exists(), "VariMesh was built without OpenCASCADE")
    def test_if_other_ways_to_slide_are_tried(self):
        flags = ["--max-iterations", "0"]  # so that elements are left
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        for out, more in ((here, []), (there, ["--server", self.server.address])):
            done = subprocess.run([VARIMESH, "optimise", BRACKET, "--geometry", MODEL, *flags, *more, "-o", out],
                                  capture_output=True, text=True)
            self.assertIn("so now all nodes move together (--slide coupled)", done.stderr)
        result = self.client.optimise(BRACKET, self.folder / "python.msh", geometry=MODEL, max_iterations=0)
        self.assertEqual(here.read_bytes(), there.read_bytes())
        self.assertEqual(here.read_bytes(), (self.folder / "python.msh").read_bytes())
        self.assertEqual(result.metrics.slide_trials[0].slide, "coupled")


if __name__ == "__main__":
    with mock.patch.dict(os.environ, VARIMESH_OPENCASCADE=str(PLUGIN)):
        support.main()
