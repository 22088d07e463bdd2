"""Arrays in and out: numbers from 0, qualities per element, callbacks, outputs, notebooks, and the functions without a
client."""
import asyncio
import os
import re
import subprocess
import sys
import unittest

import support
from support import CASES, LARGER, MESH

support.need()
import numpy as np
import varimesh
from varimesh.numbering import OF_ARRAYS, OF_FILES

# The middle node of the edge from the first vertex to the second lies beyond the second vertex.
FOLDED = ([[0, 0], [1, 0], [0, 1], [1, 1], [1.3, 0], [0.5, 0.5], [0, 0.5], [1, 0.5], [0.5, 1]],
          {"triangle": [[0, 1, 2, 4, 5, 6], [1, 3, 2, 7, 8, 5]]})


class Arrays(support.WithServer):
    def test_each_cell_has_its_quality(self):
        result = self.client.optimise(FOLDED, max_iterations=3)
        quality = result.quality
        self.assertEqual(quality.number.tolist(), [0, 1])
        self.assertEqual((quality.valid.tolist(), quality.invalid.tolist()), ([False, True], [True, False]))
        self.assertAlmostEqual(quality.scaled_jacobian.min(), result.after.min_scaled_jacobian, delta=1e-12)
        self.assertEqual(quality.uncertified.tolist(), [0])
        self.assertEqual(quality.certified, result.after.certified)

    def test_numbers_of_arrays_count_from_0_and_those_of_files_are_the_file_s(self):
        metrics = self.client.optimise(FOLDED, until="valid").metrics
        self.assertEqual({element for group in metrics.unrepairable for element in group.elements}, {0})
        self.assertTrue(all("riangle 0" in group.sentence for group in metrics.unrepairable), metrics.unrepairable)
        of_file = self.client.optimise(MESH, max_iterations=0)
        self.assertGreater(of_file.quality.number.min(), 0)
        self.assertLessEqual(set(of_file.quality.uncertified), set(of_file.quality.number))

    def test_numbers_in_options_count_from_0(self):
        start = self.client.optimise(MESH, max_iterations=0).mesh
        moved = self.client.optimise(start, max_iterations=3)
        inner = int(np.flatnonzero((moved.nodes != start.nodes).any(axis=1))[0])
        fixed = self.client.optimise(start, max_iterations=3, fix_nodes=[inner])
        np.testing.assert_array_equal(fixed.nodes[inner], start.nodes[inner])

    def test_sentences_have_the_caller_s_numbers(self):
        text = "Elements 3, 4 and 12 meet at node 7 (0, 1, 2): 60 elements of 3 kinds; split the edge."
        self.assertEqual(OF_ARRAYS.sentence(text),
                         "Elements 2, 3 and 11 meet at node 6 (0, 1, 2): 60 elements of 3 kinds; split the edge.")
        self.assertEqual(OF_FILES.sentence(text), text)
        self.assertEqual(OF_ARRAYS.sentence("Elements 1, 2, 3 and 12 more share nodes 5, 6, and 7, cells 8 to 10."),
                         "Elements 0, 1, 2 and 12 more share nodes 4, 5, and 6, cells 7 to 9.")

    def test_arrays_outlive_the_client(self):
        with varimesh.Client(self.server.address) as client:
            result = client.optimise(FOLDED, max_iterations=1)
        self.assertEqual(len(result.nodes), 9)

    def test_nodes_have_as_many_columns_as_were_given(self):
        nodes, cells = FOLDED
        self.assertEqual(self.client.optimise((nodes, cells), max_iterations=1).nodes.shape, (9, 2))
        deep = np.hstack([nodes, np.zeros((9, 1))])
        self.assertEqual(self.client.optimise((deep, cells), max_iterations=1).nodes.shape, (9, 3))

    def test_a_file_that_goes_to_a_file_has_arrays_too(self):
        result = self.client.optimise(MESH, self.folder / "out.msh", max_iterations=1)
        self.assertEqual(result.nodes.shape, (87, 3))
        without = self.client.optimise(MESH, self.folder / "out.msh", max_iterations=1, arrays=False)
        self.assertNotIn("parts", without.formats)
        self.assertEqual(len(without.quality.scaled_jacobian), 9)

    def test_cells_keep_the_numbers_of_their_file_if_the_output_is_a_picture(self):
        head, elements = MESH.read_text().split("$Elements\n16\n")
        of_101 = self.folder / "of_101.msh"  # its elements are seven lines and nine triangles, numbered from 101
        of_101.write_text(head + "$Elements\n16\n" + re.sub(r"^(\d+) ", lambda found: f"{int(found[1]) + 100} ", elements,
                                                           flags=re.MULTILINE))  # fmt: skip
        for output in (None, self.folder / "out.vtu", [self.folder / "out.vtu", self.folder / "out.msh"]):
            result = self.client.optimise(of_101, output, max_iterations=0)
            self.assertEqual(result.quality.number.tolist(), list(range(108, 117)))
            self.assertEqual(len(result.quality.uncertified), 2)
            self.assertLessEqual(set(result.quality.uncertified), set(result.quality.number))
        again = self.client.optimise(result.mesh, self.folder / "out.vtu", max_iterations=0)
        self.assertEqual(again.quality.number.tolist(), list(range(7, 16)))  # numbers of arrays, the lines included

    def test_an_exception_in_a_callback_cancels_the_job(self):
        def fail(event):
            if event.iteration is not None:
                raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            self.client.optimise(LARGER, **support.ENDLESS, labels={"for": "callback"}, on_event=fail)
        (job,) = self.client.jobs(labels={"for": "callback"})
        self.assertEqual(job.wait().state, "cancelled")

        async def awaited():
            async with varimesh.AsyncClient(self.server.address) as client:
                await client.optimise(LARGER, **support.ENDLESS, labels={"for": "awaited"}, on_event=fail)

        with self.assertRaises(ZeroDivisionError):
            asyncio.run(awaited())
        (job,) = self.client.jobs(labels={"for": "awaited"})
        self.assertEqual(job.wait().state, "cancelled")

    def test_outputs_are_checked_before_anything_is_sent(self):
        jobs = len(list(self.client.jobs()))
        for path in (self.folder / "none" / "out.msh", self.folder):
            with self.assertRaises((varimesh.BadOutput, varimesh.BadOption)):
                self.client.optimise(MESH, path)
        with self.assertRaisesRegex(varimesh.BadOutput, "there is no folder .*none; make it"):
            self.client.quality(MESH, self.folder / "none" / "out.vtu")
        self.assertEqual(len(list(self.client.jobs())), jobs)

    def test_quality_takes_what_the_command_takes(self):
        coarse, fine = self.client.quality(MESH, lattice=1), self.client.quality(MESH, lattice=40, threads=1)
        self.assertGreater(coarse.min_scaled_jacobian, fine.min_scaled_jacobian)
        marked = self.folder / "marked.vtu"
        folded = self.client.quality(FOLDED, marked, diagnose=True)
        self.assertEqual({element for group in folded.unrepairable for element in group.elements}, {0})
        self.assertIn(b"unrepairable", marked.read_bytes())
        command = subprocess.run([support.VARIMESH, "quality", MESH, "--lattice", "1", "--json"], capture_output=True,
                                 text=True, check=True).stdout
        self.assertIn(f'"min_scaled_jacobian": {coarse.min_scaled_jacobian!r}', command)
        with self.assertRaises(varimesh.Refused):
            self.client.quality(MESH, lattice=1001)

    def test_a_notebook_shows_a_picture(self):
        html = self.client.optimise(MESH)._repr_html_()
        self.assertEqual((html.count("<svg"), html.count("</svg>"), html.count("<div"), html.count("</div>")), (1, 1, 3, 3))
        self.assertIn("<td>certified valid</td><td>7</td><td>9</td>", html)

    def test_a_job_can_be_awaited(self):
        async def both():
            here = await self.client.submit(MESH, outputs=["parts"])
            async with varimesh.AsyncClient.of(varimesh.Client(self.server.address)) as client:
                there = await (await client.submit(MESH, outputs=["parts"]))
            return here, there

        here, there = asyncio.run(both())
        self.assertTrue(here.valid)
        np.testing.assert_array_equal(here.nodes, there.nodes)

    def test_addresses_and_spellings(self):
        with varimesh.Client(f"http://{self.server.address}/") as client:
            self.assertTrue(client.optimize(MESH).valid)
        with self.assertRaisesRegex(varimesh.ServerUnreachable, "speaks no TLS"):
            varimesh.Client(f"https://{self.server.address}/", connect=0.5).info()
        job = self.client.submit(MESH)
        self.assertEqual((job.file, job.labels), (MESH.name, {"file": MESH.name}))
        self.assertIsNotNone(job.submitted.tzinfo)

    def test_three_lines_without_a_client(self):
        program = ("import varimesh\n"
                   "nodes, cells = [[0, 0], [1, 0], [0, 1], [1, 1], [.5, .7]], "
                   "{'triangle': [[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4]]}\n"
                   "result = varimesh.optimise((nodes, cells))\n"
                   "print(result.nodes[4].tolist(), varimesh.quality(result.mesh).valid.all(), varimesh.optimize is "
                   "varimesh.optimise)\n")
        environment = {key: value for key, value in os.environ.items() if key != "VARIMESH_SERVER"}
        for more in ({}, {"VARIMESH_SERVER": self.server.address}):
            jobs = len(list(self.client.jobs()))
            done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60,
                                  env={**environment, **more})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, r"^\[0\.5, 0\.7\] True True")
            self.assertEqual(len(list(self.client.jobs())) - jobs, 1 if more else 0)


class Unbuilt(support.WithFolder):
    def test_importing_the_sources_says_what_to_build(self):
        done = subprocess.run([sys.executable, "-c", "import varimesh"], capture_output=True, text=True,
                              env={**os.environ, "PYTHONPATH": str(support.SOURCE / "client" / "python")})
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, "ImportError: The package varimesh .* is not built: .* --target varimesh_python")

    def test_missing_modules_are_named(self):
        hide = ("import sys\nclass Hide:\n    def find_spec(self, name, path=None, target=None):\n"
                "        if name.split('.')[0] in ('grpc', 'numpy'): raise ModuleNotFoundError(name)\n"
                "sys.meta_path.insert(0, Hide())\nimport varimesh")
        done = subprocess.run([sys.executable, "-c", hide], capture_output=True, text=True)
        self.assertIn("run 'pip install numpy grpcio', or on Debian 'apt-get install python3-numpy python3-grpcio'",
                      done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
