"""Reports from Python: the page that the command writes, as a file, as text and in a notebook."""
import json
import os
import re
import shutil
import subprocess
import time
import unittest
from pathlib import Path
from unittest import mock

import support
from support import CASES, LARGER, MESH

support.need()
import varimesh
from varimesh import pages, requirements


def scene(page):
    """What the pictures of a page show."""
    report = json.loads(re.search(r'<script[^>]* id="report"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    arrays = re.search(r'<script[^>]* id="arrays"[^>]*>(.*?)</script>', page, re.DOTALL)[1]
    assert arrays.strip()
    return report["scene"], arrays


class Pages(support.WithServer):
    def test_a_result_is_saved_as_the_report_of_the_command(self):
        ours, theirs = self.folder / "ours.html", self.folder / "theirs.html"
        result = self.client.optimise(MESH, [self.folder / "out.msh", ours])
        subprocess.run([support.VARIMESH, "result", result.job, "--report", theirs, "--server", self.client.address, "--quiet"],
                       check=True)
        self.assertEqual(ours.read_text(), theirs.read_text())
        self.assertIn("Convergence", ours.read_text())
        self.assertEqual(result.report(), ours.read_text())

    def test_a_mesh_from_arrays_has_pictures_too(self):
        start = self.client.optimise(CASES / "sphere_p3.msh", max_iterations=0).mesh
        of_file = self.client.optimise(CASES / "sphere_p3.msh", max_iterations=2)
        of_arrays = self.client.optimise(start, max_iterations=2)
        self.assertEqual(of_arrays.formats, ["parts"])
        jobs = {job.name for job in self.client.jobs()}
        page = of_arrays.report()
        self.assertNotIn("There is no picture", page)
        self.assertEqual(scene(page), scene(of_file.report()))
        self.assertEqual({job.name for job in self.client.jobs()}, jobs)  # nothing is left of what wrote the files

    def test_what_cannot_be_written_is_said(self):
        result = self.client.optimise(MESH)
        with self.assertRaisesRegex(varimesh.BadOutput, "none"):
            result.save(self.folder / "none" / "r.html")
        with varimesh.Client(self.client.address) as other:
            other._for_command = None  # as with gRPC's credentials
            with self.assertRaisesRegex(varimesh.BadOption, "varimesh result jobs/.* --report"):
                other.job(result.job).result().save(self.folder / "r.html")

    def test_what_no_report_can_be_written_for_is_said_before_the_work(self):
        def never(event):
            self.fail("the work began")

        outputs = [self.folder / "r.html", self.folder / "out.msh"]
        for_command, self.client._for_command = self.client._for_command, None  # as with gRPC's credentials
        try:
            with self.assertRaisesRegex(varimesh.BadOption, "varimesh result JOB --report"):
                self.client.optimise(MESH, outputs, on_event=never)
        finally:
            self.client._for_command = for_command
        no_program = self.folder / "varimesh"
        no_program.write_text("")
        for said in (no_program, self.folder, self.folder / "gone"):
            with self.subTest(said.name), mock.patch.dict(os.environ, VARIMESH=str(said)):
                with self.assertRaisesRegex(varimesh.BadOutput, "set VARIMESH"):
                    self.client.optimise(MESH, outputs, on_event=never)
                self.assertNotIn("<iframe", self.client.optimise(MESH)._repr_html_())

    def test_a_program_of_the_wheel_that_may_not_be_changed_is_passed_over(self):
        (self.folder / "bin").mkdir()
        (self.folder / "bin" / "varimesh").write_text("")
        with (mock.patch.object(requirements, "_HERE", self.folder), mock.patch.dict(os.environ, VARIMESH=""),
              mock.patch.object(Path, "chmod", side_effect=PermissionError)):  # fmt: skip
            self.assertEqual(requirements.find_program("varimesh", "VARIMESH"), shutil.which("varimesh"))

    def test_the_meshes_are_there_if_the_report_fails(self):
        command = self.folder / "command"
        command.write_text("#!/nowhere/shell\n")
        command.chmod(0o755)
        with mock.patch.dict(os.environ, VARIMESH=str(command)), self.assertRaisesRegex(varimesh.BadOutput, "cannot be run"):
            self.client.optimise(MESH, [self.folder / "r.html", self.folder / "out.msh"])
        self.assertTrue((self.folder / "out.msh").exists())

    def test_a_notebook_waits_for_no_queue(self):
        """Reports of meshes in arrays need a job of their own."""
        start = self.client.optimise(MESH, max_iterations=0).mesh
        result = self.client.optimise(start)
        busy = [self.client.submit(LARGER, threads=0, **support.ENDLESS) for _ in range(os.cpu_count() + 1)]
        self.addCleanup(lambda: [one.cancel() for one in busy])
        while self.client.job(busy[0].name).state == "pending":
            time.sleep(0.01)
        jobs = {job.name for job in self.client.jobs()}
        begun = time.monotonic()
        with mock.patch.object(pages, "MOST_SECONDS", 2.0):
            self.assertNotIn("<iframe", result._repr_html_())
        self.assertLess(time.monotonic() - begun, 6)
        self.assertEqual({job.name for job in self.client.jobs()}, jobs)  # the job that waited is gone

    def test_a_notebook_shows_the_report_of_a_small_mesh(self):
        result = self.client.optimise(MESH)
        html = result._repr_html_()
        self.assertIn('<iframe title="Report of the mesh" sandbox="allow-scripts" srcdoc="', html)
        pages.MOST_ELEMENTS, most = 8, pages.MOST_ELEMENTS
        try:
            self.assertNotIn("<iframe", result._repr_html_())
        finally:
            pages.MOST_ELEMENTS = most

    def test_what_is_printed_is_short(self):
        result = self.client.optimise(MESH)
        for one in (result, result.mesh, result.mesh.blocks[0], result.metrics, result.after, result.quality, self.client, *self.client.job(result.job).watch()):
            self.assertLess(len(repr(one)), 400, one)
            self.assertNotIn("\n", repr(one))
        self.assertIn("9 of 9 cells certified valid", repr(result.quality))
        self.assertIn("9 triangle", repr(result.mesh))


if __name__ == "__main__":
    unittest.main(verbosity=2)
