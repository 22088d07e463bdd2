"""A server slides the boundary nodes: 'varimesh optimise --geometry FILE --server ADDRESS'. Where VariMesh was built without
OpenCASCADE, only what a server without it does is tested, and the rest is skipped with a word."""
import json
import re
import signal
import unittest
from pathlib import Path

from programs import CASES, ENDLESS, VARIMESH, Server, WithFolder, run, start, wait_for_line

BRACKET, MODEL = CASES / "geometry" / "bracket_p3.msh", CASES / "geometry" / "bracket.brep"
PLUGIN = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
IN_THIS_PROCESS = "The server takes no geometries, so the job runs in this process."


class Geometry(WithFolder):
    """What all servers have in common."""

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.msh"

    def optimise(self, *flags, mesh=BRACKET, model=MODEL, out=None):
        return run("optimise", mesh, "--geometry", model, "-o", out or self.out, "--threads", 1, *flags)


@unittest.skipUnless(PLUGIN.exists(), "VariMesh was built without OpenCASCADE")
class OnAServer(Geometry):
    @classmethod
    def setUpClass(cls):
        cls.server = Server(VARIMESH_OPENCASCADE=str(PLUGIN))

    @classmethod
    def tearDownClass(cls):
        status, left = cls.server.stop()
        assert (status, left) == (0, []), f"varimeshd ended with {status} and left {left}: {''.join(cls.server.log)}"

    def remote(self, *flags, **files):
        return self.optimise(*flags, "--server", self.server.address, **files)

    def jobs(self):
        return json.loads(run("jobs", "--json", "--server", self.server.address).stdout)["jobs"]

    def test_the_result_has_the_same_bytes_as_without_a_server(self):
        here, there = self.folder / "here", self.folder / "there"
        meshes = [BRACKET]
        for name, flags in (("text.msh", ["--format", "msh22"]), ("fields.vtu", [])):
            meshes.append(self.folder / name)
            self.assertEqual(run("convert", BRACKET, meshes[-1], *flags).returncode, 0)
        for mesh in meshes:
            for flags in ([], ["--slide", "surfaces", "--snap", "--smooth-angle", 5],
                          ["--slide", "coupled", "--geometry-tolerance", 0.5]):
                with self.subTest(mesh=mesh.name, flags=flags):
                    outs = [path.with_suffix(mesh.suffix) for path in (here, there)]
                    alone = self.optimise(*flags, mesh=mesh, out=outs[0])
                    done = self.remote(*flags, mesh=mesh, out=outs[1])
                    self.assertEqual(done.returncode, alone.returncode, done.stderr)
                    self.assertIn(done.returncode, (0, 4), done.stderr)
                    self.assertEqual(outs[0].read_bytes(), outs[1].read_bytes())

    def test_the_server_slides_and_says_so_once(self):
        done = self.remote()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn(IN_THIS_PROCESS, done.stderr)
        self.assertEqual(len(re.findall(r"boundary nodes slid on", done.stderr)), 1)
        self.assertEqual(len(re.findall(r"13 of 13 surfaces of the mesh matched", done.stderr)), 1)

    def test_the_figures_and_the_report_have_the_boundary_before_and_after(self):
        page = self.folder / "report.html"
        done = self.remote("--json", "--report", page)
        self.assertEqual(done.returncode, 0, done.stderr)
        geometry = json.loads(done.stdout)["geometry"]
        self.assertGreater(geometry["nodes"], 0)
        self.assertLess(geometry["distance"]["after"]["rms"], geometry["distance"]["before"]["rms"])
        report = json.loads(re.search(r'id="report">(.*?)</script>', page.read_text(), re.DOTALL)[1])
        self.assertEqual(report["document"]["geometry"], geometry)
        skins = [one["snapshots"] for one in report["scene"]["sets"] if one["set"] == "skin"]
        self.assertEqual(set(skins), {2})

    def test_the_figures_of_each_surface_are_those_of_a_run_without_a_server(self):
        model = MODEL.with_suffix(".step")
        alone, done = self.optimise("--json", model=model), self.remote("--json", model=model)
        geometry = json.loads(done.stdout)["geometry"]
        self.assertEqual(json.loads(alone.stdout)["geometry"], geometry)
        surfaces = {one["surface"]: one for one in geometry["surfaces"]}
        self.assertEqual(len(surfaces), 13)
        self.assertEqual((surfaces[4]["name"], surfaces[4]["tags"], surfaces[11]["name"]), ("Fillet", [4], ""))
        self.assertEqual(sum(one["folded"]["before"] for one in surfaces.values()), geometry["folded"]["before"])
        for when in ("before", "after"):
            self.assertAlmostEqual(max(one["distance"][when]["largest"] for one in surfaces.values()),
                                   geometry["distance"][when]["largest"], delta=1e-9)
        far = geometry["surfaces"][0]
        said = f"The boundary is farthest from the geometry on surface {far['surface']} '{far['name']}' ("
        for text in (alone.stderr, done.stderr):
            self.assertEqual(text.count(said), 1, text)

    def test_lists_of_jobs_leave_out_the_distances_of_elements(self):
        self.assertEqual(self.remote().returncode, 0)
        self.assertNotIn("numbers", run("jobs", "--json", "--server", self.server.address).stdout)

    def test_a_mesh_with_elements_left_is_compared_with_one_that_did_not_slide(self):
        # With its curves held, every surface stays folded as it came.
        flags = ["--slide", "surfaces", "--max-iterations", 0]
        before = len(self.jobs())
        here = self.folder / "here.msh"
        alone, done = self.optimise(*flags, out=here), self.remote(*flags, "--request-id", "one")
        for text in (alone.stderr, done.stderr):
            self.assertIn("without sliding, for comparison", text)
            self.assertEqual(len(re.findall(r"surfaces of the mesh matched", text)), 1)
        self.assertEqual((alone.returncode, here.read_bytes()), (done.returncode, self.out.read_bytes()))
        new = self.jobs()[:len(self.jobs()) - before]
        self.assertEqual([job["request_id"] for job in new], ["one"])

    def test_if_elements_are_left_all_nodes_move_together_and_then_nothing_slides(self):
        before = len(self.jobs())
        long_id = "i" * 128
        here = self.folder / "here.msh"
        flags = ["--max-iterations", 0]
        alone, done = self.optimise(*flags, out=here), self.remote(*flags, "--request-id", long_id)
        for text in (alone.stderr, done.stderr):
            self.assertRegex(text, r"so now all nodes move together \(--slide coupled\)")
        self.assertEqual((alone.returncode, here.read_bytes()), (done.returncode, self.out.read_bytes()))
        # All that is tried is one job.
        self.assertEqual([job["request_id"] for job in self.jobs()[:len(self.jobs()) - before]], [long_id])
        trials = json.loads(self.remote(*flags, "--json").stdout)["slide_trials"]
        self.assertEqual(trials[0]["slide"], "coupled")
        self.assertIn(trials[0]["outcome"], ("taken", "no-better"))
        # Who names what slides, gets that.
        self.assertNotIn("all nodes move together", self.optimise(*flags, "--slide", "all", out=here).stderr)

    def test_a_job_that_was_left_running_is_found_again(self):
        process = start("optimise", BRACKET, "--geometry", MODEL, "-o", self.out, *ENDLESS, "--server", self.server.address)
        wait_for_line(process, "residual")
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130, stderr)
        name = re.search(r"varimesh watch (\S+) ", stderr)[1]
        self.assertFalse(self.out.exists())
        self.assertEqual(run("cancel", name, "--server", self.server.address).returncode, 0)
        self.assertIn("nodes slid", run("watch", name, "--server", self.server.address).stderr)
        self.assertIn(run("result", name, "--server", self.server.address, "-o", self.out).returncode, (0, 4))
        self.assertTrue(self.out.exists())

    def test_what_cannot_be_used_gives_the_same_sentence_as_without_a_server(self):
        cut, header = self.folder / "cut.brep", self.folder / "cut.step"
        cut.write_bytes(MODEL.read_bytes()[:5000])
        header.write_bytes(b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('a'),'2;1');")
        for model in (cut, header):
            alone, done = self.optimise(model=model), self.remote(model=model)
            self.assertEqual((alone.returncode, done.returncode), (3, 3), done.stderr)
            self.assertIn(f"The geometry '{model}' cannot be used", done.stderr)
            self.assertEqual(done.stderr.splitlines()[-1], alone.stderr.splitlines()[-1])
        for files, flags, status, sentence in (
                ({"model": self.folder / "none.step"}, [], 3, "none.step' cannot be read"),
                ({}, ["--fix", "no"], 2, "'no'"),
                ({}, ["--order", 4], 2, "--order")):
            done = self.remote(*flags, **files)
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertIn(sentence, done.stderr)
        self.assertFalse(self.out.exists())

    def test_jobs_that_are_submitted_slide_too(self):
        here, other, text = self.folder / "here.msh", self.folder / "other.msh", self.folder / "text.msh"
        self.assertEqual(run("convert", BRACKET, text, "--format", "msh22").returncode, 0)
        flags = ["--slide", "surfaces", "--smooth-angle", 5]
        done = run("submit", BRACKET, text, "--geometry", MODEL, *flags, "--server", self.server.address)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        for name, mesh in zip(done.stdout.split(), (BRACKET, text)):
            self.assertIn(run("wait", name, "--server", self.server.address).returncode, (0, 4))
            self.assertIn(run("result", name, "-o", other, "--server", self.server.address).returncode, (0, 4))
            self.assertIn(self.optimise(*flags, mesh=mesh, out=here).returncode, (0, 4))
            self.assertEqual(here.read_bytes(), other.read_bytes())

    def test_flags_of_submit_that_do_not_go_together_are_refused(self):
        for flags, word in ((["--slide", "none"], "--geometry"), (["--snap"], "--geometry"),
                            (["--geometry", MODEL, "--order", 4], "--order"),
                            (["--geometry", MODEL, "--free-nodes", 7], "--fix")):
            done = run("submit", BRACKET, *flags, "--server", self.server.address)
            self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
            self.assertIn(word, done.stderr)

    def test_a_surface_alone_needs_no_server(self):
        text, mesh = self.folder / "text.msh", self.folder / "surface.msh"
        self.assertEqual(run("convert", BRACKET, text, "--format", "msh22").returncode, 0)
        lines = text.read_text().splitlines()
        at = lines.index("$Elements")
        kept = [line for line in lines[at + 2:lines.index("$EndElements")] if line.split()[1] == "21"]
        mesh.write_text("\n".join([*lines[:at + 1], str(len(kept)), *kept, "$EndElements"]) + "\n")
        done = self.remote(mesh=mesh)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("surface in space", done.stderr)
        self.assertIn("slide without a server", done.stderr)


class OnAServerWithoutGeometries(Geometry):
    def test_the_job_runs_in_the_process_of_the_command(self):
        here = self.folder / "here.msh"
        alone = self.optimise(out=here)
        for flags, environment in ((["--isolation", "none"], {"VARIMESH_OPENCASCADE": str(PLUGIN)}),
                                   ([], {"VARIMESH_OPENCASCADE": str(self.folder / "none.so")})):
            with self.subTest(flags=flags):
                server = Server(*flags, **environment)
                self.addCleanup(server.stop)
                info = json.loads(run("info", "--server", server.address, "--json").stdout)
                self.assertFalse(info["takes_geometries"])
                done = self.optimise("--server", server.address)
                self.assertIn(IN_THIS_PROCESS, done.stderr)
                self.assertEqual(done.returncode, alone.returncode, done.stderr)
                if PLUGIN.exists():
                    self.assertEqual(here.read_bytes(), self.out.read_bytes())
                else:
                    self.assertIn("installed without OpenCASCADE", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
