"""varimesh-mpi: several processes print what one prints, and all end soon if one of them cannot go on."""
import array
import fcntl
import json
import os
import re
import signal
import struct
import subprocess
import termios
import time
from pathlib import Path

from programs import CASES, VARIMESH, run
from ranks import PERMITTED, SECONDS_TO_END, VARIMESH_MPI, WithMeshes, command, launch, main, ranks_of

MESHES = ["nine_triangles.msh", "circle_p5.msh", "annulus_p3.msh", "aerofoil_p4.msh", "reentrant_3_of_5.msh",
          "pin_p3.msh", "solid_ball_p3.msh", "thick_layer_p3.msh"]
HDF5 = os.environ.get("VARIMESH_HDF5") or Path(VARIMESH).resolve().parent.parent / "lib" / "varimesh" / "varimesh_hdf5"
# Megabytes of memory of its own that a process may have (RLIMIT_DATA). In the address space, what MPI's processes have in
# common would count for each.
LIMIT = 160


def unread_bytes(pipe):
    count = array.array("i", [0])
    fcntl.ioctl(pipe, termios.FIONREAD, count)
    return count[0]


def has_ended(process):
    """Whether no process has this id, or only one that nobody has waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


class Bytes(WithMeshes):
    """Standard output is that of plain varimesh, byte for byte."""

    def assert_same(self, mesh, *flags, ranks=(1, 2, 3, 5)):
        plain = run("quality", mesh, *flags)
        self.assertIn(plain.returncode, (0, 4), plain.stderr)
        for count in ranks:
            with self.subTest(mesh.name, ranks=count, flags=flags):
                done = launch(count, "quality", mesh, *flags)
                self.assertEqual(done.returncode, plain.returncode, done.stderr)
                self.assertEqual(done.stdout, plain.stdout)
                for line in plain.stderr.splitlines():
                    self.assertEqual(done.stderr.splitlines().count(line), 1)

    def test_summaries(self):
        for name in MESHES:
            self.assert_same(self.binary(name), "--certify")

    def test_documents(self):
        for name in MESHES:
            self.assert_same(self.binary(name), "--json", ranks=(1, 3))

    def test_flags(self):
        mesh = self.binary("reentrant_3_of_5.msh")
        self.assert_same(mesh, "--diagnose", ranks=(2, 3))
        self.assert_same(mesh, "--lattice", "3", "--threads", "2", ranks=(2,))

    def test_a_larger_mesh(self):
        self.assert_same(self.grid(12), "--certify", "--json", ranks=(1, 2, 5))

    def test_standard_output_comes_when_standard_error_has_been_read(self):
        """Open MPI 5.0.7 would add the beginning of a line of standard output to the line of standard error."""
        mesh = self.binary("reentrant_3_of_5.msh")
        with subprocess.Popen([VARIMESH_MPI, "quality", mesh, "--certify", "--json"], env=PERMITTED, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE) as process:
            deadline = time.monotonic() + 30
            while not unread_bytes(process.stderr):
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.01)
            time.sleep(0.5)
            self.assertEqual(unread_bytes(process.stdout), 0)
            self.assertIn(b"invalid", process.stderr.read())
            self.assertIn(b'"elements"', process.stdout.read())


class Optimise(WithMeshes):
    """The result of several processes has the bytes of the plain program's."""
    SECONDS = re.compile(r"[0-9.e-]+ s\b|\"seconds\": [0-9.e-]+")

    def without_seconds(self, text):
        return self.SECONDS.sub("some time", text)

    @staticmethod
    def content(page):
        """A report without where it comes from and how long it took: its document, and all its arrays."""
        before, mark, rest = page.read_text().partition('<script type="application/json" id="report">')
        report, end, after = rest.partition("</script>")
        assert mark and end, f"{page} has no document"
        report = json.loads(report)
        del report["origin"], report["document"]["seconds"], report["history"]["seconds"]
        return json.dumps(report), before, after

    def assert_same(self, mesh, *flags, ranks=(1, 2, 3, 5, 8), objective="energy"):
        alone, together = self.folder / "alone.msh", self.folder / "together.msh"
        histories = self.folder / "alone.csv", self.folder / "together.csv"
        pages = self.folder / "alone.html", self.folder / "together.html"
        arguments = ["optimise", mesh, *(["--objective", objective] if objective else []), *flags]
        plain = run(*arguments, "-o", alone, "--history", histories[0], "--report", pages[0])
        self.assertIn(plain.returncode, (0, 4), plain.stderr)
        self.assertNotEqual(alone.read_bytes(), Path(mesh).read_bytes())
        for count in ranks:
            with self.subTest(mesh=mesh.name, ranks=count, flags=flags):
                done = launch(count, *arguments, "-o", together, "--history", histories[1], "--report", pages[1])
                self.assertEqual(done.returncode, plain.returncode, done.stderr)
                self.assertEqual(self.content(pages[1]), self.content(pages[0]))
                self.assertEqual(together.read_bytes(), alone.read_bytes())
                self.assertEqual(self.without_seconds(done.stdout), self.without_seconds(plain.stdout))
                rows = [[row.split(",") for row in path.read_text().splitlines()] for path in histories]
                timed = [i for i, name in enumerate(rows[0][0]) if name.startswith("seconds")]
                self.assertTrue(timed)
                for mine, theirs in zip(rows[1], rows[0], strict=True):
                    self.assertEqual([x for i, x in enumerate(mine) if i not in timed],
                                     [x for i, x in enumerate(theirs) if i not in timed])
                together.unlink()

    def test_meshes_of_the_cases(self):
        for name in ("circle_p5.msh", "annulus_p3.msh", "aerofoil_p4.msh", "pin_p3.msh", "solid_ball_p3.msh",
                     "thick_layer_p3.msh"):
            self.assert_same(self.binary(name), "--threads", "1", ranks=(1, 3))

    def test_a_mesh_that_every_rank_has_cells_of(self):
        self.assert_same(self.grid(13), "--threads", "1")
        self.assert_same(self.grid(13), "--threads", "2", "--json", ranks=(2, 3))

    def test_the_default_objective(self):
        for name in ("circle_p5.msh", "annulus_p3.msh", "aerofoil_p4.msh", "pin_p3.msh", "solid_ball_p3.msh",
                     "thick_layer_p3.msh"):
            self.assert_same(self.binary(name), "--threads", "1", ranks=(1, 3), objective=None)
        self.assert_same(self.grid(13), "--threads", "1", objective=None)
        self.assert_same(self.grid(13), "--threads", "2", "--json", ranks=(2, 3), objective=None)

    def test_a_mesh_that_comes_in_invalid(self):
        for objective in ("energy", None):
            self.assert_same(self.binary("reentrant_3_of_5.msh"), "--threads", "1", ranks=(2,), objective=objective)

    def test_a_report_of_a_result_that_cannot_be_read(self):
        """The page needs the result in a format that can be read, and this one is not written to a file."""
        mesh, page = self.binary("circle_p5.msh"), self.folder / "page.html"
        done = launch(2, "optimise", mesh, "-o", self.folder / "out.vtu", "--report", page)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({path.name for path in self.folder.iterdir()}, {mesh.name, "out.vtu", "page.html"})
        plain = self.folder / "plain.html"
        self.assertEqual(run("optimise", mesh, "-o", self.folder / "out.vtu", "--report", plain).returncode, 0)
        self.assertEqual(self.content(page), self.content(plain))

    def test_a_file_that_cannot_be_written(self):
        mesh = self.binary("circle_p5.msh")
        out = self.folder / "nowhere" / "out.msh"
        done = launch(2, "optimise", mesh, "--objective", "energy", "-o", out)
        plain = run("optimise", mesh, "--objective", "energy", "-o", out)
        self.assertEqual(done.returncode, plain.returncode)
        self.assertIn(plain.stderr.strip(), done.stderr)


class Refusals(WithMeshes):
    def assert_refused(self, status, words, *arguments):
        done = launch(2, *arguments)
        self.assertEqual(done.returncode, status, done.stderr)
        lines = [line for line in done.stderr.splitlines() if line.startswith("varimesh: ")]
        self.assertEqual(len(lines), 1, done.stderr)
        self.assertIn(words, lines[0])
        self.assertEqual(done.stdout.count("scaled Jacobian"), 0)

    def test_what_ranks_do_not_do_yet(self):
        mesh = self.binary("nine_triangles.msh")
        self.assert_refused(2, "shares only the work of 'quality' and of 'optimise'", "convert", mesh,
                            self.folder / "out.msh")
        self.assert_refused(2, "does not take --report", "quality", mesh, "--report", self.folder / "report.html")
        self.assert_refused(2, "does not take --output", "quality", mesh, "-o", self.folder / "out.vtu")
        self.assert_refused(2, "flags that repair", "quality", mesh, "--merge-nodes", "1e-9")
        self.assertEqual([path.name for path in self.folder.iterdir()], [mesh.name])

    def test_what_optimise_does_not_share_yet(self):
        mesh = self.binary("nine_triangles.msh")
        optimise = ("optimise", mesh, "-o", self.folder / "out.msh")
        for flags, words in ((["--order", "3"], "does not take --order"), (["--repair", "split"], "does not take --repair"),
                             (["--device", "gpu"], "does not take --device gpu"),
                             (["--device", "auto"], "does not take --device auto"),
                             (["--request-id", "wing-1"], "does not take --request-id"),
                             (["--slide-on", "boundary"], "does not take a geometry"),
                             (["--merge-nodes", "1e-9"], "does not take flags that change the mesh"),
                             (["--objective", "worst"], "does not take --objective worst"),
                             (["--history", "-"], "does not take standard output"),
                             (["--report", "-"], "does not take standard output")):
            self.assert_refused(2, words, *optimise, *flags)
        self.assert_refused(2, "'varimesh optimise --into'", "optimise", mesh, "--into", self.folder / "out", "--objective",
                            "energy")
        self.assert_refused(2, "does not take standard output", "optimise", mesh, "-o", "-", "--objective", "energy")
        self.assert_refused(3, "cannot be", "optimise", self.folder / "missing.msh", "-o", self.folder / "out.msh",
                            "--objective", "energy")
        self.assertEqual([path.name for path in self.folder.iterdir()], [mesh.name])

    def test_files_that_ranks_do_not_read(self):
        self.assert_refused(3, "must be a binary file of Gmsh's MSH 4.1", "quality", CASES / "nine_triangles.msh")
        self.assert_refused(3, "cannot be opened", "quality", self.folder / "missing.msh")

    def test_a_surface_in_space(self):
        mesh = self.folder / "surface.msh"
        run("convert", CASES / "sphere_p3.msh", mesh, "--format", "msh41-binary")
        if run("quality", mesh).stdout.startswith("surface"):
            self.assert_refused(3, "surface in space", "quality", mesh)

    def test_only_this_program_is_linked_with_mpi(self):
        libraries = lambda program: subprocess.run(["ldd", program], capture_output=True, text=True).stdout
        self.assertIn("libmpi", libraries(VARIMESH_MPI))
        self.assertNotIn("libmpi", libraries(VARIMESH))

    def test_help_and_version_are_printed_once(self):
        self.assertEqual(launch(3, "--version").stdout, run("--version").stdout)
        self.assertEqual(launch(2, "quality", "--help").stdout, run("quality", "--help").stdout)


class Failures(WithMeshes):
    def test_a_fault_in_one_part_of_the_file_ends_all(self):
        mesh = self.grid(8)
        data = bytearray(mesh.read_bytes())
        at = data.rfind(b"\n$EndElements") - 8
        data[at:at + 8] = struct.pack("<Q", 10**9)
        mesh.write_bytes(data)
        began = time.monotonic()
        done = launch(3, "quality", mesh)
        self.assertLess(time.monotonic() - began, SECONDS_TO_END)
        self.assertEqual(done.returncode, 3)
        self.assertEqual(done.stderr.count("varimesh: "), 1, done.stderr)
        self.assertIn("refers to node 1000000000", done.stderr)
        self.assertIn(f"byte {at + 8}", done.stderr)
        self.assertIn(run("quality", mesh).stderr.strip(), done.stderr)

    def optimise_without_hdf5_on_the_second(self, mesh, out, status):
        """The second of three ranks cannot start the program that reads and writes HDF5 files, and all end soon."""
        if not Path(HDF5).exists():
            self.skipTest("VariMesh was built without HDF5")
        before = {path.name for path in self.folder.iterdir()}
        script = 'test "$OMPI_COMM_WORLD_RANK" != 1 || export VARIMESH_HDF5=/nowhere; exec "$0" "$@"'
        began = time.monotonic()
        done = subprocess.run(["mpirun", "-n", "3", "sh", "-c", script, VARIMESH_MPI, "optimise", mesh, "-o", out, "--objective",
                               "energy", "--threads", "1"], capture_output=True, text=True, timeout=100, env=PERMITTED)
        self.assertLess(time.monotonic() - began, SECONDS_TO_END)
        self.assertEqual(done.returncode, status, done.stderr)
        self.assertEqual(done.stderr.count("varimesh: "), 1, done.stderr)
        self.assertIn("installed without HDF5", done.stderr)
        self.assertEqual(done.stdout.count("scaled Jacobian"), 0)
        self.assertEqual({path.name for path in self.folder.iterdir()}, before)

    def test_a_rank_that_alone_cannot_read_the_mesh_ends_all(self):
        mesh = self.folder / "ball.cgns"
        self.assertEqual(run("convert", CASES / "solid_ball_p3.msh", mesh).returncode, 0)
        self.optimise_without_hdf5_on_the_second(mesh, self.folder / "out.msh", 3)

    def test_a_rank_that_alone_cannot_write_the_mesh_ends_all(self):
        self.optimise_without_hdf5_on_the_second(CASES / "pin_p3.msh", self.folder / "out.cgns", 2)

    def kill_one_of(self, *arguments):
        """Kills the second of three ranks after two seconds. All end soon, and standard output is returned."""
        process = subprocess.Popen(command(3, *arguments), env=PERMITTED, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        ranks = ranks_of(process, 3)
        time.sleep(2)
        self.assertIsNone(process.poll(), "the ranks ended before one was killed")
        os.kill(ranks[1], signal.SIGKILL)
        began = time.monotonic()
        stdout, stderr = process.communicate(timeout=30)
        self.assertLess(time.monotonic() - began, SECONDS_TO_END)
        self.assertNotEqual(process.returncode, 0)
        self.assertEqual(stdout.count("scaled Jacobian"), 0)
        self.assertIn("Killed", stderr)
        while not all(map(has_ended, ranks)):
            self.assertLess(time.monotonic() - began, SECONDS_TO_END)
            time.sleep(0.05)

    def test_a_killed_rank_ends_all(self):
        self.kill_one_of("quality", self.grid(40), "--lattice", "60", "--threads", "1")

    def test_a_killed_rank_ends_a_run_and_leaves_no_result(self):
        mesh = self.grid(30)
        self.kill_one_of("optimise", mesh, "--objective", "energy", "-o", self.folder / "out.msh", "--threads", "1")
        self.assertEqual([path.name for path in self.folder.iterdir()], [mesh.name])


class Memory(WithMeshes):
    def limited(self, launcher, program, arguments):
        """Runs the program, or several with a launcher, with at most LIMIT megabytes each."""
        return self.finished([*launcher, "sh", "-c", f'ulimit -d {LIMIT * 1024}; exec "$0" "$@"', program, *arguments])

    def finished(self, words):
        return subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=200, env=PERMITTED)

    def test_a_mesh_that_no_rank_can_hold(self):
        """Plain varimesh has no room for the mesh, and each of eight ranks has for its part."""
        mesh = self.grid(72)
        arguments = ["quality", mesh, "--certify", "--threads", "1"]
        whole = self.limited([], VARIMESH, arguments)
        self.assertNotEqual(whole.returncode, 0)
        self.assertIn("memory", whole.stderr)
        parts = self.limited(["mpirun", "-n", "8"], VARIMESH_MPI, arguments)
        self.assertEqual(parts.returncode, 0, parts.stderr)
        self.assertEqual(parts.stdout, self.finished([VARIMESH, *arguments]).stdout)

    def test_a_run_for_which_a_rank_has_no_room(self):
        mesh = self.grid(40)
        began = time.monotonic()
        ranks = self.limited(["mpirun", "-n", "2"], VARIMESH_MPI,
                             ["optimise", mesh, "--objective", "energy", "-o", self.folder / "out.msh", "--threads", "1"])
        self.assertLess(time.monotonic() - began, 60)
        self.assertNotEqual(ranks.returncode, 0)
        self.assertIn("not enough memory: each rank holds the whole mesh", ranks.stderr)
        self.assertEqual([path.name for path in self.folder.iterdir()], [mesh.name])


if __name__ == "__main__":
    main()
