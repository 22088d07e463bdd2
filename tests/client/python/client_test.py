"""The client as a program uses it, with a real server."""
import dataclasses
import io
import math
import os
import pty
import re
import subprocess
import time
import unittest
import unittest.mock

import support
from support import CASES, LARGER, MESH, VARIMESH

support.need()
import numpy as np
import varimesh
from varimesh import numbering, options, reports
from varimesh.v1 import quality_pb2


class Client(support.WithServer):
    def test_writes_the_same_bytes_as_the_command(self):
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        subprocess.run([VARIMESH, "optimise", MESH, "-o", here, "--energy", "winslow", "--quiet"], check=True)
        result = self.client.optimise(MESH, there, energy="winslow")
        self.assertEqual(here.read_bytes(), there.read_bytes())
        self.assertTrue(result.valid)
        self.assertEqual((result.metrics.energy, result.before.certified.invalid, result.after.certified.valid),
                         ("winslow", 2, 9))
        self.assertEqual(result.metrics.objective, "energy")
        self.assertEqual(self.client.optimise(MESH).metrics.objective, "accuracy")
        self.assertEqual(result.before.uncertified.tolist(), sorted(result.before.uncertified.tolist()))
        self.assertEqual(len(result.history), result.metrics.iterations)
        self.assertEqual(set(result.history["phase"]), {"sweeps", "newton"})
        self.assertEqual((result.history["linear_solve"][0], result.history["linear_solve"][-1]), ("none", "solved"))
        self.assertEqual((result.history["left_elements"][0], result.history["left_elements"][-1]), (2, 0))
        self.assertEqual(result.history["residual"][-1], result.metrics.residual)

    def test_writes_clockwise_elements_as_they_came_or_turned(self):
        start = self.client.optimise(MESH, max_iterations=0).mesh
        cells = start.cells["triangle"]
        turned = cells[:, [0, 2, 1, 11, 10, 9, 8, 7, 6, 5, 4, 3, 12, 14, 13]]
        usual = self.client.optimise((start.nodes, {"triangle": cells}))
        self.assertEqual((usual.metrics.notes, usual.before.clockwise_elements), ((), 0))
        for orient, expected in ((False, turned), (True, cells)):
            result = self.client.optimise((start.nodes, {"triangle": turned}), orient=orient)
            np.testing.assert_array_equal(result.nodes, usual.nodes)
            np.testing.assert_array_equal(result.mesh.cells["triangle"], expected)
            self.assertEqual(result.before.clockwise_elements, 9)
            self.assertEqual(len(result.before.clockwise), 9)
            self.assertEqual(result.after.clockwise_elements, 0 if orient else 9)
            self.assertIn("All 9 elements are numbered clockwise", result.metrics.notes[0])

    def test_arrays_give_the_same_bits_as_the_file(self):
        for case, shape in ((MESH, "triangle"), (CASES / "sphere_p3.msh", "tetrahedron")):
            of_file = self.client.optimise(case, max_iterations=3)
            start = self.client.optimise(case, max_iterations=0).mesh
            of_arrays = self.client.optimise((start.nodes, start.blocks), max_iterations=3)
            np.testing.assert_array_equal(of_arrays.nodes, of_file.nodes)
            np.testing.assert_array_equal(of_arrays.mesh.cells[shape], start.cells[shape])
            self.assertFalse(np.array_equal(of_arrays.nodes, start.nodes))

    def test_a_mesh_needs_no_boundary_elements(self):
        """The boundary is found without the elements that mark it."""
        start = self.client.optimise(MESH, max_iterations=0).mesh
        result = self.client.optimise((start.nodes[:, :2], start.cells))
        self.assertEqual((result.after.certified.valid, result.formats), (9, ["parts"]))

    def test_saves_the_requested_formats(self):
        msh, vtu, later = (self.folder / name for name in ("a.msh", "a.vtu", "b.msh"))
        result = self.client.optimise(MESH, [msh, vtu], format="msh41", arrays=True)
        self.assertTrue(msh.read_bytes().startswith(b"$MeshFormat\n4.1 0 8"))
        self.assertIn(b"VTKFile", vtu.read_bytes()[:200])
        self.assertEqual(result.nodes.shape, (87, 3))
        result.save(later)
        self.assertEqual(later.read_bytes(), msh.read_bytes())
        with self.assertRaises(varimesh.BadOption):
            result.save(later, format="msh22")
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["a.msh", "a.vtu", "b.msh"])

    def test_a_file_appears_only_when_complete_and_a_link_stays_a_link(self):
        target, link = self.folder / "target.msh", self.folder / "link.msh"
        target.write_text("old")
        target.chmod(0o640)
        link.symlink_to(target.name)
        self.client.optimise(MESH, link)
        self.assertTrue(link.is_symlink())
        self.assertEqual(target.stat().st_mode & 0o777, 0o640)
        self.assertGreater(target.stat().st_size, 1000)
        with self.assertRaises(varimesh.Refused):
            self.client.download("0" * 64, target)
        self.assertGreater(target.stat().st_size, 1000)
        self.assertEqual(len(list(self.folder.iterdir())), 2)

    def test_a_request_id_gives_one_job(self):
        first = self.client.submit(MESH, request_id="python-once", labels={"for": "test"})
        again = self.client.submit(MESH, request_id="python-once", labels={"for": "test"})
        self.assertEqual(first.name, again.name)
        with self.assertRaises(varimesh.Refused) as caught:
            self.client.submit(MESH, request_id="python-once", energy="winslow")
        self.assertEqual(caught.exception.reason, "REQUEST_ID_USED")
        self.assertEqual([job.name for job in self.client.jobs(labels={"for": "test"})], [first.name])
        self.assertEqual(first.wait().state, "succeeded")
        self.assertIn(first.name, [job.name for job in self.client.jobs(["succeeded"])])
        self.assertEqual(first.result().job, first.name)
        first.delete()
        with self.assertRaises(varimesh.Refused) as caught:
            first.refresh()
        self.assertEqual(caught.exception.reason, "JOB_NOT_FOUND")

    def test_events_are_in_order_and_resume_after_a_number(self):
        job = self.client.submit(MESH)
        # Work that is reported inside a long iteration has the number of the event before it.
        events = [event for event in job.watch() if event.work is None]
        numbers = [event.sequence for event in events]
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertEqual([event.state for event in events if event.state][-1], "succeeded")
        self.assertEqual([event.stage for event in events if event.stage], ["before", "after"])
        rest = list(job.watch(after=numbers[3]))
        self.assertEqual([event.sequence for event in rest if event.state], [events[-1].sequence])
        with self.assertRaises(varimesh.BadOption):
            list(job.watch(after=10**6))

    def test_errors_have_the_reason_of_the_server(self):
        bad = self.folder / "bad.msh"
        bad.write_bytes(MESH.read_bytes()[:300])
        with self.assertRaises(varimesh.JobFailed) as failed:
            self.client.optimise(bad)
        self.assertEqual(failed.exception.reason, "BAD_INPUT")
        self.assertRegex(failed.exception.sentence, ".{20,}")
        for reason, call in (("JOB_NOT_FOUND", lambda: self.client.job("none")),
                             ("MESH_NOT_FOUND", lambda: self.client.download("0" * 64)),
                             ("BAD_OPTION", lambda: self.client.optimise(MESH, tolerance=-1))):
            with self.assertRaises((varimesh.Refused, varimesh.JobFailed)) as caught:
                call()
            self.assertEqual(caught.exception.reason, reason)
            self.assertIn(reason, str(caught.exception))
        with self.assertRaises(FileNotFoundError):
            self.client.optimise(self.folder / "missing.msh")
        with self.assertRaises(varimesh.BadOption):
            self.client.optimise(MESH, "out.xyz")

    def test_a_cancelled_job_has_the_best_mesh_so_far(self):
        with self.running(outputs=["parts"]) as job:
            with self.assertRaises(varimesh.Refused) as caught:
                job.result()
            self.assertEqual(caught.exception.reason, "JOB_NOT_SUCCEEDED")
            self.assertIn(job.cancel().state, ("cancelling", "cancelled"))
            self.assertEqual(job.wait().state, "cancelled")
            result = job.result()
        self.assertEqual((result.state, result.metrics.stop_reason), ("cancelled", "stopped"))
        self.assertEqual(result.nodes.shape[1], 3)

    def test_a_job_cancelled_by_someone_else_raises_an_error(self):
        def cancel(event):
            if event.iteration is not None:
                next(self.client.jobs(labels={"for": "someone"})).cancel()

        with self.assertRaises(varimesh.JobCancelled) as caught:
            self.client.optimise(LARGER, self.folder / "out.msh", **support.ENDLESS, labels={"for": "someone"},
                                 on_event=cancel)
        self.assertEqual(self.client.job(caught.exception.job).state, "cancelled")
        self.assertFalse((self.folder / "out.msh").exists())

    def test_reports_unrepairable_elements_and_repair_steps(self):
        # The middle node of the edge from the first vertex to the second lies beyond the second vertex.
        nodes = [[0, 0], [1, 0], [0, 1], [1, 1], [1.3, 0], [0.5, 0.5], [0, 0.5], [1, 0.5], [0.5, 1]]
        folded = (nodes, {"triangle": [[0, 1, 2, 4, 5, 6], [1, 3, 2, 7, 8, 5]]})
        named = self.client.optimise(folded, until="valid").metrics
        self.assertIn(0, {element for group in named.unrepairable for element in group.elements})
        self.assertEqual(named.repairs, ())
        left = named.left
        self.assertEqual((left.uncertified, left.proved, left.unproved), (1, 1, 0))
        self.assertIn("1 element", left.sentence)
        self.assertTrue(left.remedies)
        boundary = left.remedies[-1]
        self.assertEqual((boundary.kind, boundary.arguments, boundary.elements), ("other-boundary", {}, 1))
        self.assertIn("Mesh the boundary anew or refine it: nothing else is known to help element 0", boundary.sentence)
        judged = self.client.optimise(folded, max_iterations=0).metrics.left.remedies
        for one in judged:
            self.assertNotIn("--", one.sentence)  # no flags of the command
            self.assertIn(one.kind, ("optimise", "more-time", "until-valid", "other-boundary"))
        self.assertEqual(named.remedies, tuple(one.sentence for one in left.remedies))
        steps = self.client.optimise(folded, repair="straighten").metrics.repairs
        self.assertLessEqual({step.kind for step in steps}, {"straightened", "left"})
        self.assertTrue(steps and all(step.sentence and step.elements for step in steps))

    def test_every_kind_of_remedy_has_words_and_arguments_that_are_taken(self):
        for name, number in quality_pb2.Remedy.Kind.items():
            message = quality_pb2.Remedy(kind=number, order=3, elements=2, reason="it helps.", sentence="As the server says.")
            made = reports.remedy_of(message, numbering.OF_FILES)
            self.assertEqual(made.sentence == message.sentence, number == 0, name)
            self.assertEqual(made.sentence.endswith(": it helps."), number != 0, name)
            self.assertNotIn("--", made.sentence)
            options.to_message({key: value for key, value in made.arguments.items() if key != "geometry"})
            if name == "KIND_SLIDE":
                self.assertEqual(made.arguments["geometry"].slide_on, "boundary")

    def test_quality_moves_nothing_and_leaves_no_job(self):
        before = len(list(self.client.jobs()))
        quality = self.client.quality(MESH)
        self.assertEqual((quality.certified.invalid, quality.certified.valid), (2, 7))
        self.assertGreater(quality.accuracy.loss, 0)
        self.assertEqual(len(quality.accuracy.modal_parts), 3)  # degrees 2 to 4
        self.assertEqual(len(list(self.client.jobs())), before)

    def test_writes_elements_at_their_own_orders_if_asked_to(self):
        two, out = self.folder / "two.msh", self.folder / "out.msh"
        two.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n7\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 1 1 0\n5 0.5 0 0\n"
                       "6 0.5 0.5 0\n7 0 0.5 0\n$EndNodes\n$Elements\n2\n1 9 2 1 1 1 2 3 5 6 7\n2 2 2 1 1 2 4 3\n"
                       "$EndElements\n")  # fmt: skip
        self.client.optimise(two, out, keep_orders=True)
        self.assertEqual(out.read_text(), two.read_text())
        self.client.optimise(two, out)
        self.assertNotEqual(out.read_text(), two.read_text())
        older = dataclasses.replace(self.client.info(), keeps_orders=False)
        with self.assertRaisesRegex(varimesh.BadOption, "too old for keep_orders"):
            older.check(keep_orders=True)

    def test_info_has_version_energies_and_formats(self):
        info = self.client.info()
        self.assertEqual(info.version, varimesh.__version__)
        self.assertIn("hyperelastic", info.energies)
        self.assertIn("parts", info.input_formats)


class Bar(support.WithServer):
    def show(self, stream):
        show = varimesh.Progress(stream=stream)
        job = self.client.submit(LARGER, max_iterations=30)
        for event in job.watch():
            show(event)

    def test_prints_plain_lines_if_the_stream_is_not_a_terminal(self):
        text = io.StringIO()
        self.show(text)
        self.assertRegex(text.getvalue(), r"residual \d\.\d+e")
        self.assertTrue(text.getvalue().endswith("succeeded\n"))
        self.assertNotRegex(text.getvalue(), "[\r\x1b]")

    def test_rewrites_one_line_on_a_terminal(self):
        ours, theirs = pty.openpty()
        with os.fdopen(theirs, "w") as terminal:
            self.show(terminal)
            text = os.read(ours, 65536).decode()
        os.close(ours)
        self.assertRegex(text, re.escape("\r\x1b[K[") + r"[#.]{16}\] ")

    def event(self, **values):
        known = dict.fromkeys(varimesh.Iteration.__dataclass_fields__, 0) | {"phase": "sweeps", "seconds_left": None} | values
        return varimesh.Event(1, 1, None, 0, iteration=varimesh.Iteration(**known))

    def test_counts_down_the_seconds_that_the_job_says_are_left(self):
        text = io.StringIO()
        show = varimesh.Progress(stream=text)
        self.assertIsNone(show.seconds_left())
        begun = time.monotonic()
        show(self.event(seconds_left=90.0))
        left = show.seconds_left()
        self.assertIn("about 90 s left", text.getvalue())
        self.assertTrue(90 - (time.monotonic() - begun) - 1e-6 <= left <= 90 + 1e-6, left)
        show(self.event())
        self.assertIsNone(show.seconds_left())

    def test_leaves_out_whole_figures_in_narrow_terminals(self):
        event = self.event(phase="untangle", number=12345, residual=3.79e-2, min_scaled_jacobian=-0.5, invalid_elements=123456,
                           left_elements=123456, seconds=1234.5, seconds_left=90.0)  # fmt: skip
        for columns in range(10, 140):
            terminal = io.StringIO()
            terminal.isatty = lambda: True
            with unittest.mock.patch.dict(os.environ, COLUMNS=str(columns)):
                varimesh.Progress(stream=terminal)(event)
            text = terminal.getvalue().removeprefix("\r\x1b[K")
            self.assertLess(len(text), columns)
            self.assertEqual("certified" in text, "certified 123456" in text, text)
            self.assertEqual("about" in text, "about 90 s left" in text, text)
            self.assertTrue(columns < 80 or ("certified" in text and "left" in text), text)

    def test_the_bar_goes_on_ever_slower_while_the_job_cannot_tell_its_end(self):
        terminal = io.StringIO()
        terminal.isatty = lambda: True
        show = varimesh.Progress(stream=terminal)
        for seconds, left in ((10.0, 30.0), (20.0, None), (40.0, None), (10_000.0, None)):
            show._shown = -math.inf
            show(self.event(seconds=seconds, seconds_left=left, residual=1.0))
            self.assertEqual("left" in terminal.getvalue().split("\r")[-1], left is not None)
        text = terminal.getvalue()
        self.assertEqual([bar.count("#") for bar in re.findall(r"\[([#.]{16})\]", text)], [4, 10, 13, 15])

    def test_shows_no_figure_of_a_mesh_that_would_not_be_handed_out(self):
        for values, is_shown in (({"min_scaled_jacobian": 0.5}, True), ({"min_scaled_jacobian": -0.5}, False),
                                 ({"min_scaled_jacobian": -0.5, "invalid_elements": 2, "left_elements": 2}, True),
                                 ({"min_scaled_jacobian": -0.5, "invalid_elements": 2, "left_elements": 1}, False)):
            text = io.StringIO()
            varimesh.Progress(stream=text)(self.event(**values))
            self.assertEqual("min Js" in text.getvalue(), is_shown, text.getvalue())


if __name__ == "__main__":
    unittest.main(verbosity=2)
