"""Boundary nodes slide on a CAD model in jobs that a program submits. Skipped, with a word, without OpenCASCADE."""
import asyncio
import os
import subprocess
from pathlib import Path
from unittest import mock

import support
from support import CASES, VARIMESH

support.need()
import numpy as np
import varimesh
from varimesh.v1 import job_pb2, service_pb2

BRACKET, MODEL = CASES / "geometry" / "bracket_p3.msh", CASES / "geometry" / "bracket.brep"
PLUGIN = Path(VARIMESH).parent / "libvarimesh_opencascade.so"


class Geometry(support.WithServer):
    def test_writes_the_same_bytes_as_the_command(self):
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        subprocess.run([VARIMESH, "optimise", BRACKET, "--geometry", MODEL, "-o", here, "--quiet"], check=True)
        result = self.client.optimise(BRACKET, there, geometry=MODEL)
        self.assertEqual(here.read_bytes(), there.read_bytes())
        report = result.metrics.geometry
        self.assertGreater(report.nodes, 0)
        self.assertGreater(report.farthest, 0)
        self.assertLess(report.rms_after, report.rms_before)
        self.assertLess(report.largest_after, report.largest_before)
        self.assertEqual((report.folded_before, report.folded_after), (1, 0))
        self.assertIn("13 of 13 surfaces", report.sentences[0])
        self.assertEqual(len(report.surfaces), 13)
        self.assertAlmostEqual(report.surfaces[0].largest_after, report.largest_after, delta=1e-9)
        self.assertEqual(sum(one.folded_before for one in report.surfaces), 1)
        named = self.client.optimise(BRACKET, geometry=MODEL.with_suffix(".step")).metrics.geometry
        self.assertEqual({one.surface: one.name for one in named.surfaces}[4], "Fillet")
        self.assertIsNone(self.client.optimise(BRACKET, max_iterations=0).metrics.geometry)

    def test_arrays_slide_to_the_same_bits_as_the_file(self):
        start = self.client.optimise(BRACKET, max_iterations=0).mesh
        of_file = self.client.optimise(BRACKET, geometry=MODEL)
        of_arrays = self.client.optimise(start, geometry=MODEL)
        np.testing.assert_array_equal(of_arrays.nodes, of_file.nodes)

    def test_its_options_count(self):
        model = varimesh.Geometry(MODEL, slide="none", snap=True, smooth_angle=5)
        job = self.client.submit(BRACKET, geometry=model).wait()
        sent = job._message.spec.geometry
        self.assertEqual((sent.slide, sent.snap, sent.smooth_angle), (job_pb2.Geometry.SLIDE_NONE, True, 5))
        self.assertEqual(job.result().metrics.geometry.nodes, 0)
        sent = varimesh.Geometry(MODEL, slide="coupled", tolerance=0.5).to_message()
        self.assertEqual((sent.slide, sent.tolerance), (job_pb2.Geometry.SLIDE_COUPLED, 0.5))

    def test_the_client_for_asyncio_has_it_too(self):
        async def optimised():
            async with varimesh.AsyncClient(self.server.address) as client:
                return await client.optimise(BRACKET, geometry=MODEL), await (await client.submit(BRACKET, geometry=MODEL))

        for result in asyncio.run(optimised()):
            self.assertGreater(result.metrics.geometry.nodes, 0)

    def test_a_private_server_with_processes_takes_it(self):
        with varimesh.local(processes=True) as client:
            self.assertTrue(client.info().takes_geometries)
            self.assertTrue(client.optimise(BRACKET, geometry=MODEL).valid)

    def test_what_cannot_be_used_has_a_sentence(self):
        cut = self.folder / "cut.step"
        cut.write_bytes(b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('a'),'2;1');")
        with self.assertRaisesRegex(varimesh.JobFailed, "The geometry cannot be used: the STEP file is cut off") as failed:
            self.client.optimise(BRACKET, geometry=cut)
        self.assertEqual(failed.exception.reason, "BAD_INPUT")
        with self.assertRaisesRegex(varimesh.BadOption, "did you mean 'surfaces'"):
            self.client.submit(BRACKET, geometry=varimesh.Geometry(MODEL, slide="surface"))
        with self.assertRaises(FileNotFoundError):
            self.client.submit(BRACKET, geometry=self.folder / "none.step")
        with self.assertRaisesRegex(varimesh.Refused, "order"):
            self.client.submit(BRACKET, geometry=MODEL, order=4)

    def test_an_unknown_digest_is_refused(self):
        spec = job_pb2.JobSpec()
        spec.mesh.digest = self.client.upload(BRACKET)
        spec.geometry.digest = "a" * 64
        with self.assertRaises(varimesh.Refused) as refused:
            self.client._connection.call(self.client._jobs.SubmitJob,
                                         service_pb2.SubmitJobRequest(request_id="unknown", spec=spec))  # fmt: skip
        self.assertEqual(refused.exception.reason, "MESH_NOT_FOUND")
        self.assertIn("geometry " + "a" * 64, str(refused.exception))

    def test_a_server_without_geometries_is_told_apart(self):
        with varimesh.local() as client:
            self.assertFalse(client.info().takes_geometries)
            with self.assertRaisesRegex(varimesh.BadOption, "takes no geometries"):
                client.submit(BRACKET, geometry=MODEL)


if __name__ == "__main__":
    if not PLUGIN.exists():
        support.skip("VariMesh was built without OpenCASCADE")
    with mock.patch.dict(os.environ, VARIMESH_OPENCASCADE=str(PLUGIN)):
        support.main()
