"""varimesh doctor: what it finds, and its colours."""
import json
import os
import pty
import subprocess
import unittest

from programs import LARGER, MESH, VARIMESH, Server, WithFolder, run


class Doctor(WithFolder):
    def test_finds_nothing_wrong_with_this_machine(self):
        found = json.loads(run("doctor", "--json").stdout)
        self.assertEqual(list(found), ["varimesh", "grpc", "protobuf", "processor", "vectors", "threads",
                                       "temporary files", "CAD plugin", "gmsh", "HDF5 program", "device"])
        self.assertFalse([one for one in found.values() if one["wrong"]])
        self.assertRegex(found["vectors"]["found"], "^(EMU128|SCALAR|SSE4|SSSE3|SSE2|AVX2|AVX3|AVX3_DL|NEON)$")
        self.assertEqual(found["threads"]["found"].split()[0], str(len(os.sched_getaffinity(0))))

    def test_says_which_optional_parts_are_missing_and_what_for(self):
        found = json.loads(run("doctor", "--json", env={**os.environ, "PATH": str(self.folder)}).stdout)
        self.assertEqual(found["gmsh"], {"found": "missing (for varimesh mesh)", "wrong": ""})
        self.assertIn("(for --geometry, curve and mesh)", found["CAD plugin"]["found"])

    def device(self, driver, state=""):
        """What doctor says of the device of a machine with this driver."""
        done = run("doctor", "--json", env={**os.environ, "LD_LIBRARY_PATH": str(driver), "FAKE_CUDA": state})
        self.assertEqual(done.returncode, 0, done.stdout)
        device = json.loads(done.stdout)["device"]
        self.assertEqual(device["wrong"], "", "a machine without a device is well")
        return device["found"]

    def test_says_which_device_there_is_or_why_there_is_none(self):
        fake, older = os.environ["FAKE_DRIVER"], os.environ["OLDER_DRIVER"]
        self.assertEqual(self.device(fake, "memory=150110011392"),
                         "Fake Card 1, 139.8 GiB, compute capability 9.0; driver for CUDA 12.4")
        self.assertEqual(self.device(fake, "cards=2").count("Fake Card 1"), 2)
        for driver, state, pattern in ((fake, "cards=0", "^The NVIDIA driver finds no device"),
                                       (fake, "version=9020", "too old: it is for CUDA 9.2"),
                                       (fake, "result=803", "restart the machine"),
                                       (older, "", "too old: it has no function cuDriverGetVersion")):
            self.assertRegex(self.device(driver, state), pattern)
        (self.folder / "libcuda.so.1").write_text("no library")
        self.assertRegex(self.device(self.folder), "^There is no NVIDIA driver on this machine .*file too short|invalid ELF")

    def test_says_whether_kernels_compute_what_the_processor_computes(self):
        def found(state):
            done = run("doctor", "--json", env={**os.environ, "LD_LIBRARY_PATH": os.environ["FAKE_DRIVER"], "FAKE_CUDA": state})
            kernels = json.loads(done.stdout)["device kernels"]
            return done.returncode, kernels["found"], kernels["wrong"]

        well = found("")
        if "has no kernels" in well[1]:
            self.skipTest("VariMesh was built without clang")
        self.assertEqual(well, (0, "compute the processor's bits", ""))
        for state, words in (("busy", "in use by another process"), ("memory=100000", "has no room for"),
                             ("capability=61", "is too old"), ("load=222", "install a later driver"),
                             ("shared=49152", "bytes of shared memory per block")):
            status, sentence, wrong = found(state)
            self.assertIn(words, sentence)
            self.assertEqual((status, wrong), (0, ""), "a device that cannot be used is not wrong")
        for state, words in (("lost=3", "failed when it ran the kernel"), ("lost_at_wait=9", "failed when"),
                             ("load=218", "did not accept the kernels"), ("wrong", "computes other numbers")):
            status, sentence, wrong = found(state)
            self.assertEqual((status, sentence), (1, "do not work"))
            self.assertIn(words, wrong)

    def test_finds_what_is_wrong(self):
        server = Server()
        self.addCleanup(server.stop)
        well = run("doctor", "--server", server.address)
        self.assertEqual(well.returncode, 0, well.stdout)
        self.assertIn("answered in", well.stdout)
        away = run("doctor", "--server", "127.0.0.1:1")
        self.assertEqual(away.returncode, 5)
        self.assertIn("no  server", away.stdout)
        full = run("doctor", env={**os.environ, "TMPDIR": "/proc"})
        self.assertEqual(full.returncode, 1)
        self.assertIn("set TMPDIR", full.stdout)


class Colour(WithFolder):
    def test_is_used_only_on_a_terminal(self):
        for arguments in (["--help"], ["doctor"], ["quality", MESH], ["optimise", LARGER, "-o", self.folder / "o.msh"]):
            done = run(*arguments)
            self.assertNotIn("\x1b", done.stdout + done.stderr, arguments)

    def on_a_terminal(self, **environment):
        ours, theirs = pty.openpty()
        process = subprocess.Popen([VARIMESH, "doctor"], stdout=theirs, env={**os.environ, **environment})
        process.wait(20)
        os.close(theirs)
        text = os.read(ours, 65536).decode()
        os.close(ours)
        return text

    def test_is_not_used_on_a_terminal_with_no_color(self):
        self.assertIn("\x1b[32mok\x1b[0m", self.on_a_terminal(NO_COLOR=""))
        self.assertNotIn("\x1b", self.on_a_terminal(NO_COLOR="1"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
