"""Hostile code in each program that reads strangers' bytes: what it tries, once the program is in its sandbox, must not get
through. ctest runs it with VARIMESH, VARIMESHD, VARIMESH_SOURCE_DIR, and CAPTURED: captured.so and captured_program."""
import json
import os
import re
import shutil
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "client"))
from programs import CASES, ENDLESS, LARGER, VARIMESHD, Server, WithFolder, run  # noqa: E402

BUILT = Path(VARIMESHD).parents[1]
REAL = {name: BUILT / folder / name for name, folder in (("varimesh_worker", "lib/varimesh"), ("varimesh_hdf5", "lib/varimesh"),
                                                         ("varimesh_cad_reader", "client"))}
PLUGIN = BUILT / "client/libvarimesh_opencascade.so"


def children(parent, name):
    """The processes of this name that this one has started."""
    for folder in Path("/proc").iterdir():
        try:
            if re.match(rf"\d+ \({name}\) \S {parent} ", (folder / "stat").read_text()):
                yield int(folder.name)
        except OSError:
            continue


def wait_for(condition, seconds=20):
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)
    return value


class Captured(WithFolder):
    def setUp(self):
        super().setUp()
        library, program = os.environ["CAPTURED"].split(":")
        (self.folder / "real").mkdir()
        shutil.copy(library, self.folder / "captured.so")
        for name, real in REAL.items():
            if real.is_file():
                shutil.copy(real, self.folder / "real" / name)
                shutil.copy(program, self.folder / name)
        if PLUGIN.is_file():
            shutil.copy(PLUGIN, self.folder / PLUGIN.name)

    def serve(self, *names):
        """A server whose programs of these names are captured."""
        variables = {"varimesh_worker": "VARIMESH_WORKER", "varimesh_hdf5": "VARIMESH_HDF5", "varimesh_cad_reader": "VARIMESH_OPENCASCADE"}
        places = {variables[name]: str(self.folder / (PLUGIN.name if name == "varimesh_cad_reader" else name)) for name in names}
        server = Server("--isolation", "process", "--threads", "2", "--log-level", "info", **places)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        return server

    def judge(self, name):
        """All that a program of this name tried was refused. Returns the tries of the last one."""
        reports = sorted(self.folder.glob(f"{name}.report.*"), key=lambda file: file.stat().st_mtime)
        told = [lines for file in reports if (lines := [line.split() for line in file.read_bytes().rstrip(b"\0").decode().splitlines()])]
        for lines in told:
            self.assertEqual([what for what, how in lines if how == "THROUGH"], [], name)
            self.assertEqual(lines[-1], ["end", "refused"])
            self.assertGreater(len(lines), 45)
        print(f"{name}: {sum(map(len, told))} tries of {len(told)} processes, none got through")
        self.assertTrue(told, name)
        return [what for what, how in told[-1]]


class Programs(Captured):
    def optimise(self, server, mesh, *options, out="out.msh"):
        done = run("optimise", mesh, *options, "-o", self.folder / out, "--quiet", "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr + "".join(server.log))

    def test_the_worker(self):
        self.optimise(self.serve("varimesh_worker"), CASES / "cylinder_p2.msh")
        self.judge("varimesh_worker")

    def test_the_program_for_hdf5_files(self):
        if not REAL["varimesh_hdf5"].is_file():
            self.skipTest("varimesh_hdf5 is not installed")
        server = self.serve("varimesh_hdf5")
        self.optimise(server, CASES / "cylinder_p2.msh", out="out.cgns")
        self.judge("varimesh_hdf5")
        (self.folder / "threads").write_text("1")
        done = run("optimise", self.folder / "out.cgns", "-o", self.folder / "again.msh", "--server", server.address, "--max-iterations",
                   "0", "--time-limit", "1")
        self.assertNotEqual(done.returncode, 0, "the program has not gone on")
        self.assertIn("threads", self.judge("varimesh_hdf5"), "not one can be started to read")
        self.assertIn("limit-of-processes", self.judge("varimesh_hdf5"))

    def test_the_reader_of_cad_files(self):
        if not PLUGIN.is_file():
            self.skipTest("VariMesh was built without OpenCASCADE")
        (self.folder / "threads").write_text("1")
        server = self.serve("varimesh_cad_reader")
        mesh = CASES / "geometry/bracket_p3.msh"
        run("optimise", mesh, "--geometry", CASES / "geometry/bracket.igs", "--max-iterations", "1", "--time-limit", "1", "-o",
            self.folder / "out.msh", "--server", server.address)
        self.assertIn("threads", self.judge("varimesh_cad_reader"))


class Threads(Captured):
    def test_three_thousand_threads_end_the_process_and_nothing_else(self):
        (self.folder / "threads").write_text("3000")
        server = self.serve("varimesh_worker")
        begun = time.monotonic()
        done = run("submit", LARGER, *ENDLESS, "--server", server.address)
        name = done.stdout.split()[0]
        run("wait", name, "--server", server.address)
        job = next(job for job in json.loads(run("jobs", "--json", "--server", server.address).stdout)["jobs"] if job["job"] == name)
        self.assertEqual(job["state"], "failed", job)
        self.assertIn("threads", json.dumps(job))
        took = time.monotonic() - begun
        print(f"three attempts took {took:.1f} s")
        self.assertLess(took, 20)


class Secrets(Captured):
    def test_the_server_is_closed_to_others_of_its_user(self):
        """Another program of its user reads neither its environment nor its memory, and its own programs get no secrets."""
        other = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
        self.folder.chmod(0o777)
        address = self.folder / "address"
        # Copies, with the worker beside the server: the other user may not be allowed to enter the folder of the build.
        program = shutil.copy(VARIMESHD, self.folder / "real")
        server = subprocess.Popen([program, "--listen", "127.0.0.1:0", "--port-file", address, "--data", self.folder,
                                   "--isolation", "process"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                  env={**os.environ, "AWS_SECRET_ACCESS_KEY": "a secret", "TMPDIR": "/tmp"}, **other)
        self.addCleanup(server.wait)
        self.addCleanup(server.terminate)
        wait_for(address.exists)
        done = run("submit", LARGER, *ENDLESS, "--server", address.read_text().strip())
        self.assertEqual(done.returncode, 0, done.stderr)
        worker = wait_for(lambda: next(iter(children(server.pid, "varimesh_worker")), None))
        self.assertNotIn(b"secret", Path(f"/proc/{worker}/environ").read_bytes())
        for name in ("environ", "mem", "maps", "fd"):
            read = subprocess.run(["/bin/sh", "-c", f"ls /proc/{server.pid}/{name}/ || cat /proc/{server.pid}/{name}"],
                                  capture_output=True, text=True, **other)
            self.assertIn("Permission denied", read.stderr, name)
            self.assertNotEqual(read.returncode, 0, name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
