"""The command and the server as a user meets them: exit statuses, what is printed where, one path with and without a
server. Run by ctest with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment; the standard library is enough."""
import csv
import json
import os
import re
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

VARIMESH = os.environ["VARIMESH"]
VARIMESHD = os.environ["VARIMESHD"]
CASES = Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests" / "cases"
MESH = CASES / "nine_triangles.msh"
LARGER = CASES / "circle_p5.msh"
QUALITY = ["min_scaled_jacobian", "mean_scaled_jacobian", "min_distortion_jacobian", "invalid_elements", "certified"]

# Two triangles of order 2; node 5, the middle of the straight boundary edge from node 1 to node 2, lies beyond node 2.
FOLDED = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
9
1 0 0 0
2 1 0 0
3 0 1 0
4 1 1 0
5 1.3 0 0
6 0.5 0.5 0
7 0 0.5 0
8 1 0.5 0
9 0.5 1 0
$EndNodes
$Elements
2
1 9 2 1 1 1 2 3 5 6 7
2 9 2 1 1 2 4 3 8 9 6
$EndElements
"""


def run(*arguments, **keywords):
    return subprocess.run([VARIMESH, *map(str, arguments)], capture_output=True, text=True, timeout=50, **keywords)


class Server:
    """A varimeshd on a free loopback port."""

    def __init__(self, *flags, listen="127.0.0.1:0"):
        self.folder = tempfile.TemporaryDirectory()
        port_file = Path(self.folder.name) / "address"
        self.process = subprocess.Popen(
            [VARIMESHD, "--listen", listen, "--port-file", str(port_file), "--data", self.folder.name, *flags],
            stderr=subprocess.PIPE, text=True)
        self.log = []
        self.reader = threading.Thread(target=lambda: self.log.extend(self.process.stderr))
        self.reader.start()
        deadline = time.monotonic() + 20
        while not port_file.exists():
            assert self.process.poll() is None and time.monotonic() < deadline, "".join(self.log)
            time.sleep(0.01)
        self.address = port_file.read_text().strip()

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(40)
        self.reader.join()
        self.process.stderr.close()
        left = [path for path in Path(self.folder.name).iterdir() if path.is_dir()]
        self.folder.cleanup()
        return status, left


class WithFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


class InProcess(WithFolder):
    def test_prints_one_document_and_nothing_else(self):
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        self.assertEqual(list(document), ["mesh", "energy", "method", "iterations", "seconds", "residual", "converged",
                                          "stop_reason", "before", "after", "unrepairable", "repairs"])
        self.assertEqual(list(document["mesh"]), ["dimension", "order", "elements", "nodes", "free_nodes"])
        self.assertEqual(list(document["before"]), QUALITY)
        self.assertEqual(document["before"]["invalid_elements"], 2)
        self.assertEqual(document["after"]["invalid_elements"], 0)
        self.assertEqual({key: document["before"]["certified"][key] for key in ("valid", "invalid", "undecided")},
                         {"valid": 7, "invalid": 2, "undecided": 0})
        self.assertEqual(document["after"]["certified"]["valid"], 9)
        self.assertGreater(document["after"]["certified"]["min_scaled_jacobian_lower_bound"], 0)
        self.assertEqual((document["stop_reason"], document["unrepairable"]), ("converged", []))
        self.assertEqual(document["energy"], "hyperelastic")
        self.assertTrue(out.read_bytes().startswith(b"$MeshFormat\n2.2 0 8"))

    def test_writes_several_outputs_and_the_history(self):
        msh, vtu, history = (self.folder / name for name in ("a.msh", "a.vtu", "a.csv"))
        done = run("optimise", MESH, "-o", msh, "-o", vtu, "--history", history, "--quiet")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
        self.assertIn(b"VTKFile", vtu.read_bytes()[:200])
        lines = history.read_text().splitlines()
        self.assertTrue(lines[0].startswith("iteration,phase,energy,residual"))
        self.assertTrue(lines[1].startswith("1,sweeps,"), lines[1])
        for row in csv.DictReader(lines):
            self.assertEqual(row["phase"] == "newton", int(row["products"]) > 0, row)
        self.assertEqual(row["phase"], "newton")
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["a.csv", "a.msh", "a.vtu"])

    def test_shows_plain_lines_in_a_pipe(self):
        done = run("optimise", MESH, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stderr, r"residual \d\.\d+e")
        self.assertNotIn("\r", done.stderr)
        self.assertNotIn("\x1b", done.stderr)
        self.assertIn("invalid elements", done.stdout)

    def test_exits_with_4_where_invalid_elements_are_left(self):
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--max-iterations", 0, "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertEqual(json.loads(done.stdout)["iterations"], 0)
        self.assertTrue(out.exists())

    def test_exits_with_2_for_usage(self):
        out = self.folder / "out.msh"
        for arguments in (["optimise"], ["optimise", MESH], ["fly"], ["optimise", MESH, "-o", out, "--energy", "none"],
                          ["optimise", MESH, "-o", out, "--tolerance", "-1"],
                          ["optimise", MESH, "-o", self.folder / "out.xyz"],
                          ["jobs"]):
            done = run(*arguments)
            self.assertEqual(done.returncode, 2, f"{arguments}: {done.stderr}")
            self.assertTrue(done.stderr, arguments)
        self.assertFalse(out.exists())

    def test_exits_with_3_where_the_input_is_refused(self):
        whole = MESH.read_bytes()
        bad = {
            "empty file": b"",
            "not a mesh": b"solid cube\n",
            "truncated": whole[:len(whole) // 2],
            "not a number": re.sub(rb"(?m)^1 \S+ ", b"1 nan ", whole, count=1),
        }
        for name, content in bad.items():
            path, out = self.folder / "in.msh", self.folder / "out.msh"
            path.write_bytes(content)
            done = run("optimise", path, "-o", out, "--json")
            self.assertEqual(done.returncode, 3, f"{name}: {done.stderr}")
            self.assertEqual(done.stdout, "", name)
            self.assertRegex(done.stderr, r"varimesh: .{20,}", name)
            self.assertFalse(out.exists(), name)
        done = run("optimise", self.folder / "missing.msh", "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 3, done.stderr)

    def test_finds_an_output_that_cannot_be_written_before_the_work(self):
        done = run("optimise", MESH, "-o", self.folder / "missing" / "out.msh")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertNotIn("residual", done.stderr)

    def test_quality_says_how_good_a_mesh_is(self):
        done = run("quality", MESH, "--json", "--lattice", 12)
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        self.assertEqual(list(document), ["mesh", "quality", "unrepairable"])
        self.assertEqual([one["answer"] for one in document["quality"]["uncertified"]], ["invalid", "invalid"])
        self.assertEqual(document["quality"]["invalid_elements"], 2)
        self.assertEqual(document["quality"]["lattice_intervals"], 12)
        self.assertEqual(len(document["quality"]["invalid"]), 2)
        self.assertIn("invalid", run("quality", MESH).stdout)

    def test_quality_certifies_with_its_exit_status(self):
        self.assertEqual(run("quality", MESH).returncode, 0)
        done = run("quality", MESH, "--certify")
        self.assertEqual((done.returncode, done.stderr), (4, "varimesh: 2 elements are invalid\n"))
        out = self.folder / "out.msh"
        self.assertEqual(run("optimise", MESH, "-o", out, "--until", "valid", "--quiet").returncode, 0)
        self.assertEqual(run("quality", out, "--certify").returncode, 0)

    def test_quality_judges_a_mesh_that_optimise_refuses(self):
        # Node 1 goes over to the other side: the first triangle is inverted even with straight sides.
        inverted = self.folder / "inverted.msh"
        inverted.write_text(FOLDED.replace("\n1 0 0 0\n", "\n1 1 1.5 0\n"))
        self.assertEqual(run("optimise", inverted, "-o", self.folder / "out.msh").returncode, 3)
        done = run("quality", inverted, "--certify", "--diagnose")
        self.assertEqual(done.returncode, 4, done.stderr)

    def test_names_and_marks_what_cannot_be_repaired(self):
        folded, marked, out = (self.folder / name for name in ("folded.msh", "marked.msh", "out.msh"))
        folded.write_text(FOLDED)
        done = run("quality", folded, "--diagnose", "-o", marked)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"triangle 1: .*must be")
        self.assertIn('"unrepairable"', marked.read_text())
        done = run("optimise", folded, "-o", out, "--format", "msh41", "--until", "valid", "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        document = json.loads(done.stdout)
        named = {element for group in document["unrepairable"] for element in group["elements"]}
        left = {one["number"] for one in json.loads(run("quality", out, "--json").stdout)["quality"]["uncertified"]}
        self.assertEqual(document["stop_reason"], "repaired")
        self.assertTrue(left and left <= named, (left, named))
        self.assertIn('"unrepairable"', out.read_text())

    def test_says_what_repair_did(self):
        folded, out = self.folder / "folded.msh", self.folder / "out.msh"
        folded.write_text(FOLDED)
        done = run("optimise", folded, "-o", out, "--repair", "split", "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        (left,) = json.loads(done.stdout)["repairs"]
        self.assertEqual(left["kind"], "left")
        self.assertIn("Only tetrahedra can be split", left["sentence"])
        done = run("optimise", folded, "-o", out, "--repair", "straighten")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertRegex(done.stdout, r"(Made straight-sided except on the boundary|Left curved)")
        done = run("optimise", folded, "-o", out, "--repair", "split", "--region-below", "0.5")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("region_below", done.stderr)

    def test_convert_changes_the_format(self):
        binary, back = self.folder / "binary.msh", self.folder / "back.msh"
        self.assertEqual(run("convert", MESH, binary, "--format", "msh41-binary").returncode, 0)
        self.assertTrue(binary.read_bytes().startswith(b"$MeshFormat\n4.1 1 8"))
        self.assertEqual(run("convert", binary, back, "--format", "msh22").returncode, 0)
        one, other = (json.loads(run("quality", path, "--json").stdout) for path in (MESH, back))
        self.assertEqual(one, other)

    def test_ctrl_c_cancels_and_says_so(self):
        out = self.folder / "out.msh"
        process = subprocess.Popen([VARIMESH, "optimise", str(LARGER), "-o", str(out), "--method", "sweeps",
                                    "--tolerance", "1e-300", "--max-iterations", "100000000"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for line in process.stderr:
            if "residual" in line:
                break
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertIn("cancel", stderr)
        self.assertEqual(stdout, "")
        self.assertFalse(out.exists())


class WithServer(WithFolder):
    @classmethod
    def setUpClass(cls):
        cls.server = Server("--log-level", "info")

    @classmethod
    def tearDownClass(cls):
        status, left = cls.server.stop()
        assert status == 0, f"varimeshd ended with {status}: {''.join(cls.server.log)}"
        assert not left, f"varimeshd left {left}"

    def remote(self, *arguments):
        return run(*arguments, "--server", self.server.address)

    def test_gives_the_same_bytes_as_without(self):
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        self.assertEqual(run("optimise", MESH, "-o", here).returncode, 0)
        done = self.remote("optimise", MESH, "-o", there)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(here.read_bytes(), there.read_bytes())

    def test_ten_clients_at_once_get_the_bytes_of_a_lone_run(self):
        lone = self.folder / "lone.msh"
        self.assertEqual(run("optimise", LARGER, "-o", lone, "--max-iterations", 5, "--quiet").returncode in (0, 4), True)
        outs = [self.folder / f"{i}.msh" for i in range(10)]
        clients = [subprocess.Popen([VARIMESH, "optimise", str(LARGER), "-o", str(out), "--max-iterations", "5",
                                     "--quiet", "--server", self.server.address], stderr=subprocess.DEVNULL)
                   for out in outs]
        for client in clients:
            self.assertIn(client.wait(50), (0, 4))
        for out in outs:
            self.assertEqual(out.read_bytes(), lone.read_bytes())

    def test_compressed_on_the_way_it_is_the_same_mesh(self):
        plain, compressed = self.folder / "plain.msh", self.folder / "compressed.msh"
        for out, flags in ((plain, []), (compressed, ["--compress"])):
            done = self.remote("optimise", LARGER, "-o", out, "--max-iterations", "3", *flags)
            self.assertEqual(done.returncode, 4, done.stderr)
        self.assertEqual(plain.read_bytes(), compressed.read_bytes())

    def test_submit_watch_result(self):
        done = self.remote("submit", MESH, "--label", "for=test", "--request-id", "once")
        self.assertEqual(done.returncode, 0, done.stderr)
        job = done.stdout.strip()
        self.assertRegex(job, r"^jobs/[0-9a-f]{16}$")
        again = self.remote("submit", MESH, "--label", "for=test", "--request-id", "once")
        self.assertEqual(again.stdout.strip(), job)
        watched = self.remote("watch", job, "--json")
        self.assertEqual(watched.returncode, 0, watched.stderr)
        self.assertTrue(json.loads(watched.stdout)["converged"])
        out = self.folder / "out.msh"
        self.assertEqual(self.remote("result", job, "-o", out).returncode, 0)
        self.assertTrue(out.exists())
        jobs = json.loads(self.remote("jobs", "--label", "for=test", "--json").stdout)["jobs"]
        self.assertEqual([entry["job"] for entry in jobs], [job])
        self.assertEqual(jobs[0]["state"], "succeeded")

    def test_a_job_cancelled_by_someone_else_exits_with_1(self):
        process = subprocess.Popen([VARIMESH, "optimise", str(LARGER), "-o", str(self.folder / "out.msh"), "--method",
                                    "sweeps", "--tolerance", "1e-300", "--max-iterations", "100000000", "--server",
                                    self.server.address], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for line in process.stderr:
            if "residual" in line:
                break
        running = json.loads(self.remote("jobs", "--state", "running", "--json").stdout)["jobs"]
        for job in running:
            self.assertEqual(self.remote("cancel", job["job"]).returncode, 0)
        _, stderr = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 1, stderr)
        self.assertIn("someone else", stderr)

    def test_a_job_that_runs_is_not_deleted(self):
        job = self.remote("submit", LARGER, "--method", "sweeps", "--tolerance", "1e-300", "--max-iterations",
                          "100000000").stdout.strip()
        refused = self.remote("delete", job)
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertIn(f"{job} has not ended; cancel it first.", refused.stderr)
        self.assertEqual(self.remote("cancel", job).returncode, 0)
        self.assertEqual(self.remote("watch", job, "--quiet").returncode, 1)
        self.assertEqual(self.remote("delete", job).returncode, 0)

    def test_a_priority_is_kept_and_has_bounds(self):
        job = self.remote("submit", MESH, "--priority", "7", "--json")
        self.assertEqual(json.loads(job.stdout)["priority"], 7)
        self.assertEqual(self.remote("submit", MESH, "--priority", "101").returncode, 2)

    def test_bad_input_leaves_the_server_standing(self):
        path = self.folder / "bad.msh"
        path.write_bytes(MESH.read_bytes()[:300])
        self.assertEqual(self.remote("optimise", path, "-o", self.folder / "out.msh").returncode, 3)
        self.assertEqual(self.remote("optimise", MESH, "-o", self.folder / "out.msh").returncode, 0)

    def test_info(self):
        facts = json.loads(self.remote("info", "--json").stdout)
        self.assertIn("hyperelastic", facts["energies"])

    def test_an_unknown_job_is_a_usage_error(self):
        self.assertEqual(self.remote("watch", "jobs/none").returncode, 2)

    def test_a_second_server_on_the_port_refuses(self):
        second = subprocess.run([VARIMESHD, "--listen", self.server.address], capture_output=True, text=True, timeout=20)
        self.assertEqual(second.returncode, 1, second.stderr)
        self.assertIn("taken", second.stderr)


class Daemon(WithFolder):
    def test_what_is_refused_for_now_is_asked_again(self):
        server = Server("--threads", "1", "--max-pending-jobs-per-peer", "1")
        submit = ["submit", str(LARGER), "--method", "sweeps", "--tolerance", "1e-300", "--max-iterations", "100000000",
                  "--server", server.address]
        for _ in range(2):  # one runs, one waits
            waiting = run(*submit)
            self.assertEqual(waiting.returncode, 0, waiting.stderr)
        third = subprocess.Popen([VARIMESH, *submit], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        with self.assertRaises(subprocess.TimeoutExpired):
            third.wait(1)
        run("cancel", waiting.stdout.strip(), "--server", server.address)
        out, err = third.communicate(timeout=40)
        self.assertEqual(third.returncode, 0, err)
        self.assertRegex(out, r"^jobs/")
        self.assertEqual(server.stop()[0], 0)

    def test_a_misspelt_flag_is_suggested(self):
        for word, meant in (("--max-memory-byte", "'--max-memory-bytes'"), ("--listn=x", "'--listen'"),
                            ("--qqqq", "varimeshd --help")):
            done = subprocess.run([VARIMESHD, word], capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2)
            self.assertIn(meant, done.stderr)

    def test_refuses_addresses_beyond_loopback(self):
        done = subprocess.run([VARIMESHD, "--listen", "0.0.0.0:0"], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--insecure", done.stderr)

    def test_no_server_is_status_5(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % free.getsockname()[1]
        done = run("optimise", MESH, "-o", self.folder / "out.msh", "--server", address)
        self.assertEqual(done.returncode, 5, done.stderr)

    def test_sigterm_with_a_job_and_a_watcher_ends_in_order(self):
        server = Server()
        client = subprocess.Popen([VARIMESH, "optimise", str(LARGER), "-o", str(self.folder / "out.msh"), "--method",
                                   "sweeps", "--tolerance", "1e-300", "--max-iterations", "100000000", "--server",
                                   server.address], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for line in client.stderr:
            if "residual" in line:
                break
        status, left = server.stop()
        self.assertEqual((status, left), (0, []), "".join(server.log))
        client.send_signal(signal.SIGINT)  # it waits for the server to come back
        client.communicate(timeout=30)
        self.assertIn(client.returncode, (1, 5, 130))

    def test_a_socket_is_its_owners_alone(self):
        path = self.folder / "socket"
        process = subprocess.Popen([VARIMESHD, "--listen", f"unix:{path}", "--log-level", "off"],
                                   stdout=subprocess.PIPE, text=True)
        self.assertIn("unix:", process.stdout.readline())
        self.assertEqual(path.stat().st_mode & 0o777, 0o600)
        self.assertEqual(run("info", "--server", f"unix:{path}").returncode, 0)
        process.terminate()
        self.assertEqual(process.wait(20), 0)
        process.stdout.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
