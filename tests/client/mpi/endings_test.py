"""varimesh-mpi: a run that is stopped ends on all ranks, and another one goes on from its state."""
import json
import os
import re
import signal
import subprocess
import time

from programs import run
from ranks import PERMITTED, SECONDS_TO_END, WithMeshes, command, launch, main, ranks_of


class Endings(WithMeshes):
    """A run that is stopped ends on all ranks, with the mesh that it has then."""
    OPTIONS = ("--objective", "energy", "--tolerance", "1e-9", "--threads", "1")

    def expect_result_of(self, iterations, mesh, out):
        """The result is that of plain varimesh after as many iterations, or one more, whose step was made already."""
        plain = self.folder / "plain.msh"
        for most in (iterations, iterations + 1):
            done = run("optimise", mesh, *self.OPTIONS, "--max-iterations", str(most), "-o", plain)
            self.assertEqual(done.returncode, 0, done.stderr)
            if most == iterations and out.read_bytes() == plain.read_bytes():
                return
        self.assertEqual(out.read_bytes(), plain.read_bytes())

    def interrupt(self, which, number, *flags):
        """Interrupts one of three ranks of a run that has begun, and returns its iterations."""
        mesh, out = self.grid(26), self.folder / "out.msh"
        process = subprocess.Popen(command(3, "optimise", mesh, *self.OPTIONS, *flags, "-o", out), env=PERMITTED,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        ranks = ranks_of(process, 3)
        time.sleep(2.5)
        self.assertIsNone(process.poll(), "the run ended before a rank was interrupted")
        os.kill(ranks[which], number)
        began = time.monotonic()
        stdout, stderr = process.communicate(timeout=60)
        self.assertLess(time.monotonic() - began, SECONDS_TO_END)
        self.assertEqual(process.returncode, 130, stderr)
        lines = [line for line in stderr.splitlines() if line.startswith("varimesh: ")]
        self.assertEqual(len(lines), 1, stderr)
        found = re.fullmatch(r"varimesh: interrupted (?:after (\d+) iterations?|before the first iteration); the "
                             rf"(?:best mesh so far|mesh as it came) is in {re.escape(str(out))}", lines[0])
        self.assertTrue(found, lines[0])
        self.assertEqual({path.name for path in self.folder.iterdir()}, {mesh.name, out.name})
        self.expect_result_of(int(found[1] or 0), mesh, out)
        return stdout

    def test_one_rank_is_terminated(self):
        self.assertIn("stopped", self.interrupt(1, signal.SIGTERM))

    def test_the_first_rank_is_interrupted(self):
        self.assertEqual(json.loads(self.interrupt(0, signal.SIGINT, "--json"))["stop_reason"], "stopped")

    def test_a_time_limit(self):
        mesh, out = self.grid(26), self.folder / "out.msh"
        began = time.monotonic()
        done = launch(3, "optimise", mesh, *self.OPTIONS, "--time-limit", "2", "--json", "-o", out)
        self.assertLess(time.monotonic() - began, 2 + SECONDS_TO_END)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        document = json.loads(done.stdout)
        self.assertEqual(document["stop_reason"], "time-limit")
        self.expect_result_of(document["iterations"], mesh, out)

    def test_a_time_limit_that_ends_nothing(self):
        mesh, out = self.binary("pin_p3.msh"), self.folder / "out.msh"
        done = launch(3, "optimise", mesh, *self.OPTIONS, "--time-limit", "1000", "--json", "-o", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["stop_reason"], "converged")


class Checkpoints(WithMeshes):
    """A run goes on from the state that another one has left, with any number of ranks."""
    OPTIONS = ("--tolerance", "1e-9", "--threads", "1")

    def setUp(self):
        super().setUp()
        self.mesh, self.kept = self.grid(9), self.folder / "run.state"
        self.whole, self.out = self.folder / "whole.msh", self.folder / "out.msh"

    def optimise(self, ranks, *flags):
        return launch(ranks, "optimise", self.mesh, *self.OPTIONS, "--checkpoint", self.kept, "--checkpoint-interval", "0",
                      "--history", self.folder / "history.csv", "-o", self.out, *flags)

    def test_any_number_of_ranks_goes_on(self):
        for objective in ("energy", "accuracy"):
            flags = ("--objective", objective)
            plain = run("optimise", self.mesh, *self.OPTIONS, *flags, "-o", self.whole, "--json")
            self.assertEqual(plain.returncode, 0, plain.stderr)
            iterations = json.loads(plain.stdout)["iterations"]
            self.assertGreater(iterations, 3)
            done = self.optimise(3, *flags, "--max-iterations", "2")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue(self.kept.exists())
            done = self.optimise(2, *flags, "--max-iterations", "3")
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertEqual(len((self.folder / "history.csv").read_text().splitlines()), 1 + 3)
            done = self.optimise(4, *flags)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertEqual(self.out.read_bytes(), self.whole.read_bytes())
            self.assertEqual(len((self.folder / "history.csv").read_text().splitlines()), 1 + iterations)
            self.assertFalse(self.kept.exists(), "a run that has ended by itself leaves nothing to go on from")

    def test_the_state_of_another_run(self):
        self.assertEqual(self.optimise(2, "--objective", "energy", "--max-iterations", "2").returncode, 0)
        done = self.optimise(2, "--objective", "accuracy")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("so the run began anew", done.stderr)
        self.assertFalse(self.kept.exists())

    def test_a_file_that_is_no_checkpoint(self):
        self.kept.write_text("my notes")
        done = self.optimise(2)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("is no checkpoint of VariMesh", done.stderr)
        self.assertEqual(self.kept.read_text(), "my notes")
        self.assertFalse(self.out.exists())

    def test_plain_varimesh_has_no_such_flag(self):
        self.assertEqual(run("optimise", self.mesh, "--checkpoint", self.kept, "-o", self.out).returncode, 2)


if __name__ == "__main__":
    main()
