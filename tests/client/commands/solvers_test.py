"""Files of solvers, through the command: HDF5 formats here and on a server, and the files that other projects publish."""
import json
import os
import sys
import unittest
from pathlib import Path

from programs import CASES, VARIMESH, WithFolder, WithServer, run

SOLID = CASES / "sphere_p3.msh"
BALL = CASES / "solid_ball_p3.msh"
HDF5 = os.environ.get("VARIMESH_HDF5") or Path(VARIMESH).resolve().parent.parent / "lib" / "varimesh" / "varimesh_hdf5"
PUBLISHED = Path(os.environ.get("VARIMESH_CASES") or CASES.parent.parent.parent / "shared" / "cases") / "real" / "other"


def quality(path):
    return json.loads(run("quality", path, "--json").stdout)


def same(test, one, other, places=9):
    """Expects two meshes of the same quality and size."""
    test.assertEqual(one["mesh"], other["mesh"])
    for key in ("min_scaled_jacobian", "mean_scaled_jacobian"):
        test.assertAlmostEqual(one["quality"][key], other["quality"][key], places)
    for key in ("valid", "invalid", "undecided"):
        test.assertEqual(one["quality"]["certified"][key], other["quality"]["certified"][key])


class Hdf5(WithServer):
    def test_formats_in_hdf5_keep_the_mesh(self):
        for name in ("there.h5", "there.cgns"):
            there, back = self.folder / name, self.folder / "back.msh"
            done = run("convert", SOLID, there)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("has no place for", done.stderr)
            self.assertTrue(there.read_bytes().startswith(b"\x89HDF\r\n\x1a\n"))
            self.assertEqual(run("convert", there, back).returncode, 0)
            same(self, quality(SOLID), quality(back), 12)
        done = run("convert", SOLID, self.folder / "there.pyfrm")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("quality", self.folder / "there.pyfrm")
        self.assertEqual(done.returncode, 3)
        self.assertIn("PyFR, which VariMesh only writes", done.stderr)

    def test_a_server_takes_and_gives_them(self):
        info = json.loads(self.remote("info", "--json").stdout)
        for name in ("hopr", "cgns"):
            self.assertIn(name, info["input_formats"])
        for name in ("hopr", "cgns", "pyfr"):
            self.assertIn(name, info["output_formats"])
        self.assertNotIn("pyfr", info["input_formats"])
        start = self.folder / "start.cgns"
        self.assertEqual(run("convert", SOLID, start).returncode, 0)
        outputs = [self.folder / name for name in ("out.h5", "out.cgns", "out.pyfrm", "out.msh")]
        done = self.remote("optimise", start, *[word for out in outputs for word in ("-o", out)])
        self.assertEqual(done.returncode, 0, done.stderr)
        for out in outputs[:2]:
            same(self, quality(out), quality(outputs[3]), 12)
        self.assertTrue(outputs[2].read_bytes().startswith(b"\x89HDF"))

    def test_a_server_takes_and_gives_every_format(self):
        info = json.loads(self.remote("info", "--json").stdout)
        # Messages of the service, and no files.
        messages = {"parts", "cell-quality"}
        inputs, outputs = set(info["input_formats"]) - messages, set(info["output_formats"]) - messages
        endings = {"msh22": "msh", "msh22-binary": "msh", "msh41": "msh", "msh41-binary": "msh", "vtu": "vtu",
                   "mfem": "mesh", "nektar": "xml", "su2": "su2", "hopr": "h5", "cgns": "cgns", "pyfr": "pyfrm", "ism": "ism"}
        self.assertEqual(inputs, set(endings) - {"su2", "pyfr"})
        self.assertEqual(outputs, set(endings) - {"ism"})
        for name in sorted(outputs):
            with self.subTest(name):
                out, again = self.folder / f"{name}.{endings[name]}", self.folder / f"again-{name}.msh"
                done = self.remote("optimise", BALL, "-o", out, "--format", name)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertGreater(out.stat().st_size, 1000)
                if name not in inputs:
                    continue
                done = self.remote("optimise", out, "-o", again, "--time-limit", "5")
                self.assertIn(done.returncode, (0, 4), done.stderr)
                given, taken = quality(out), quality(again)
                self.assertEqual(given["mesh"]["elements"], taken["mesh"]["elements"])
                self.assertEqual(given["mesh"]["order"], taken["mesh"]["order"])
        done = self.remote("optimise", CASES.parent / "fuzz/seeds/files/plain.ism", "-o", self.folder / "ism.msh")
        self.assertIn(done.returncode, (0, 4), done.stderr)
        self.assertGreater((self.folder / "ism.msh").stat().st_size, 1000)


class Published(WithFolder):
    """Every file comes in, is optimised, goes out in its own format, and comes in again the same."""

    # What cannot be written.
    READ_ONLY = {"horses3d__CubeWithSphere5.mesh": ".msh", "startupdg.jl__MSMappedHex4P4.mesh": ".msh",
                 "mfem__cylinder-tet-p2.gen": ".msh"}  # fmt: skip

    def test_files_go_out_as_they_came(self):
        seen = 0
        for path in sorted(PUBLISHED.iterdir()):
            with self.subTest(path.name):
                seen += 1
                before = quality(path)
                out = self.folder / (path.stem + self.READ_ONLY.get(path.name, path.suffix))
                done = run("optimise", path, "-o", out, "--time-limit", 5)
                self.assertIn(done.returncode, (0, 4), done.stderr)
                after = quality(out)
                for key in ("elements", "nodes"):
                    self.assertEqual(before["mesh"][key], after["mesh"][key])
                self.assertLessEqual(after["quality"]["certified"]["invalid"], before["quality"]["certified"]["invalid"])
                again = self.folder / ("again-" + out.name)
                self.assertEqual(run("convert", out, again).returncode, 0)
                same(self, after, quality(again))
                print(f"{path.name}: {before['quality']['certified']['invalid']} -> "
                      f"{after['quality']['certified']['invalid']} invalid, status {done.returncode}", flush=True)
        self.assertEqual(seen, 11)


if __name__ == "__main__":
    if not Path(HDF5).exists():
        print("skipped: VariMesh was built without HDF5 (libhdf5-dev)")
        sys.exit(77)
    if "Published" in sys.argv and not PUBLISHED.is_dir():
        print(f"skipped: there is no folder {PUBLISHED} with files of other projects")
        sys.exit(77)
    unittest.main(verbosity=2)
