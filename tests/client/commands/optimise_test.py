"""varimesh optimise: exit statuses, what is printed where, and the same result with and without a server."""
import csv
import json
import re
import signal
import socket
import subprocess
import unittest

from programs import CASES, ENDLESS, FOLDED, LARGER, MESH, WithFolder, WithServer, clockwise, run, start, wait_for_line

QUALITY = ["min_scaled_jacobian", "mean_scaled_jacobian", "min_distortion_jacobian", "invalid_elements",
           "clockwise_elements", "certified", "accuracy"]

ONE_TRIANGLE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
3
1 0 0 0
2 1 0 0
3 0 1 0
$EndNodes
$Elements
1
1 2 2 1 1 1 2 3
$EndElements
"""


class InProcess(WithFolder):
    def test_prints_one_document_and_nothing_else(self):
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        self.assertEqual(list(document), ["mesh", "energy", "method", "objective", "iterations", "seconds", "residual",
                                          "converged", "stop_reason", "before", "after", "unrepairable", "repairs", "notes"])
        self.assertEqual(document["notes"], [])
        self.assertEqual(list(document["mesh"]), ["dimension", "order", "elements", "nodes", "free_nodes"])
        self.assertEqual(list(document["before"]), QUALITY)
        self.assertEqual(document["before"]["invalid_elements"], 2)
        self.assertEqual(document["after"]["invalid_elements"], 0)
        self.assertEqual({key: document["before"]["certified"][key] for key in ("valid", "invalid", "undecided")},
                         {"valid": 7, "invalid": 2, "undecided": 0})
        self.assertEqual(document["after"]["certified"]["valid"], 9)
        self.assertGreater(document["after"]["certified"]["min_scaled_jacobian_lower_bound"], 0)
        self.assertEqual((document["stop_reason"], document["unrepairable"]), ("converged", []))
        for stage in ("before", "after"):
            accuracy = document[stage]["accuracy"]
            self.assertEqual(len(accuracy["modal_parts"]), document["mesh"]["order"] - 1)
            self.assertGreater(accuracy["loss"], 0)
            self.assertGreater(min(accuracy["modal_parts"]), 0)
        self.assertEqual((document["energy"], document["objective"]), ("hyperelastic", "accuracy"))
        self.assertTrue(out.read_bytes().startswith(b"$MeshFormat\n2.2 0 8"))

    def test_writes_several_outputs_and_the_history(self):
        msh, vtu, history = (self.folder / name for name in ("a.msh", "a.vtu", "a.csv"))
        done = run("optimise", MESH, "-o", msh, "-o", vtu, "--history", history, "--quiet", "--objective",
                   "energy")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
        self.assertIn(b"VTKFile", vtu.read_bytes()[:200])
        lines = history.read_text().splitlines()
        self.assertTrue(lines[0].startswith("iteration,phase,energy,residual"))
        self.assertTrue(lines[1].startswith("1,sweeps,"), lines[1])
        for row in csv.DictReader(lines):
            self.assertEqual(row["phase"] == "newton", int(row["products"]) > 0, row)
            self.assertEqual(row["phase"] == "newton", row["linear_solve"] != "none", row)
        self.assertEqual((row["phase"], row["linear_solve"]), ("newton", "solved"))
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["a.csv", "a.msh", "a.vtu"])

    def test_prints_progress_as_plain_lines_in_a_pipe(self):
        done = run("optimise", MESH, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stderr, r"residual \d\.\d+e")
        self.assertNotIn("\r", done.stderr)
        self.assertNotIn("\x1b", done.stderr)
        self.assertIn("invalid elements", done.stdout)

    def test_exits_with_4_if_elements_are_still_invalid(self):
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--max-iterations", 0, "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertEqual(json.loads(done.stdout)["iterations"], 0)
        self.assertTrue(out.exists())

    def test_exits_with_2_if_the_usage_is_wrong(self):
        out = self.folder / "out.msh"
        for arguments in (["optimise"], ["optimise", MESH], ["fly"], ["optimise", MESH, "-o", out, "--energy", "none"],
                          ["optimise", MESH, "-o", out, "--tolerance", "-1"],
                          ["optimise", MESH, "-o", self.folder / "out.xyz"],
                          ["jobs"]):
            done = run(*arguments)
            self.assertEqual(done.returncode, 2, f"{arguments}: {done.stderr}")
            self.assertTrue(done.stderr, arguments)
        self.assertFalse(out.exists())

    def test_exits_with_3_if_the_input_is_refused(self):
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

    def test_exits_with_5_if_there_is_no_server(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % free.getsockname()[1]
        done = run("optimise", MESH, "-o", self.folder / "out.msh", "--server", address)
        self.assertEqual(done.returncode, 5, done.stderr)

    def test_finds_an_output_that_cannot_be_written_before_the_work(self):
        done = run("optimise", MESH, "-o", self.folder / "missing" / "out.msh")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertNotIn("residual", done.stderr)

    def test_lists_and_marks_unrepairable_elements(self):
        folded, out = self.folder / "folded.msh", self.folder / "out.msh"
        folded.write_text(FOLDED)
        done = run("optimise", folded, "-o", out, "--format", "msh41", "--until", "valid", "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        document = json.loads(done.stdout)
        unrepairable = {element for group in document["unrepairable"] for element in group["elements"]}
        left = {one["number"] for one in json.loads(run("quality", out, "--json").stdout)["quality"]["uncertified"]}
        self.assertEqual(document["stop_reason"], "repaired")
        self.assertTrue(left and left <= unrepairable, (left, unrepairable))
        self.assertIn('"unrepairable"', out.read_text())
        self.assertEqual(document["left"]["uncertified"], len(left))
        self.assertEqual(document["left"]["proved"] + document["left"]["unproved"], len(left & unrepairable))

    def test_ends_with_what_to_try_next(self):
        folded = self.folder / "folded.msh"
        folded.write_text(FOLDED)
        for done in (run("optimise", folded, "-o", self.folder / "out.msh"), run("quality", folded, "--diagnose")):
            self.assertRegex(done.stdout.splitlines()[-1], "^Mesh the boundary anew or refine it: .*elements? [0-9]")
            self.assertRegex(done.stdout, r"not certified valid(\. It|, and it) is proved that")

    def test_writes_clockwise_elements_as_they_came_or_turned(self):
        usual, mirrored, out = (self.folder / name for name in ("usual.msh", "mirrored.msh", "out.msh"))
        self.assertEqual(run("optimise", MESH, "-o", usual, "--quiet").returncode, 0)
        for elements in (range(8, 17), (9, 14)):
            mirrored.write_text(clockwise(MESH, elements))
            for flags, expected in (([], clockwise(usual, elements)), (["--keep-orientation"], clockwise(usual, elements)),
                                    (["--orient"], usual.read_text())):
                done = run("optimise", mirrored, "-o", out, *flags)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(out.read_text(), expected)
                self.assertRegex(done.stdout, "numbered clockwise")
        document = json.loads(run("optimise", mirrored, "-o", out, "--json", "--quiet").stdout)
        self.assertEqual(document["before"]["clockwise_elements"], 2)
        self.assertRegex(document["notes"][0], "^2 elements are numbered clockwise: elements 9 and 14. They are written as")

    def test_says_why_nothing_was_moved(self):
        straight, curved, best, alone, again = (self.folder / f"{name}.msh" for name in range(5))
        self.assertEqual(run("optimise", MESH, "-o", straight, "--order", 1, "--quiet").returncode, 0)
        # Only node 6 is free, so the targets stay when it moves.
        curved.write_text(FOLDED.replace("\n5 1.3 0 0\n", "\n5 0.5 -0.2 0\n"))
        self.assertEqual(run("optimise", curved, "-o", best, "--quiet", "--objective", "energy").returncode, 0)
        self.assertNotEqual(best.read_bytes(), curved.read_bytes())
        alone.write_text(ONE_TRIANGLE)
        for path, sentence, flags in ((straight, "All elements have straight sides", []),
                                      (best, "The mesh is at its optimum already", ["--objective", "energy"]),
                                      (alone, "No node is free", []), (alone, "No node is free", ["--repair", "split"]),
                                      (best, "certified valid already", ["--until", "valid"])):
            done = run("optimise", path, "-o", again, *flags)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(sentence, done.stdout)
            self.assertIn("nothing was moved", done.stdout)
            self.assertEqual(again.read_bytes(), path.read_bytes())

    def test_lowers_the_loss_of_accuracy_unless_the_energy_is_named(self):
        results = [[], ["--objective", "accuracy"], ["--energy", "hyperelastic"], ["--objective", "energy"]]
        losses = []
        for i, flags in enumerate(results):
            out = self.folder / f"{i}.msh"
            done = run("optimise", CASES / "disc_p4.msh", "-o", out, "--json", "--quiet", *flags)
            self.assertEqual(done.returncode, 0, done.stderr)
            results[i] = out.read_bytes()
            losses.append([json.loads(done.stdout)[when]["accuracy"]["loss"] for when in ("before", "after")])
        self.assertEqual(results[0], results[1])
        self.assertEqual(results[2], results[3])
        self.assertLess(losses[0][1], 0.6 * losses[0][0])
        self.assertGreater(losses[2][1], losses[2][0])

    def test_says_which_option_makes_the_energy_the_objective(self):
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--tolerance", "1e-2", "--lambda", "2")
        self.assertIn("objective: energy, because --lambda, --tolerance are given; --objective accuracy", done.stdout)
        for flags in ([], ["--objective", "energy", "--tolerance", "1e-2"]):
            self.assertNotIn("objective: energy, because", run("optimise", MESH, "-o", out, *flags).stdout)

    def test_refuses_an_option_that_changes_nothing(self):
        out = self.folder / "out.msh"
        for flags, user in ((["--kappa", 3], "linear-elastic"), (["--energy", "winslow", "--lambda", 3], "hyperelastic"),
                            (["--strain", "small"], "linear-elastic"), (["--rings", 3], "region_below")):
            done = run("optimise", MESH, "-o", out, *flags)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(user, done.stderr)
            self.assertFalse(out.exists())

    def test_names_the_way_to_a_curved_mesh(self):
        straight, out = self.folder / "straight.msh", self.folder / "out.msh"
        self.assertEqual(run("optimise", CASES / "cylinder_p2.msh", "-o", straight, "--order", 1, "-q").returncode, 0)
        self.assertIn("curve the mesh on its CAD model", run("optimise", straight, "-o", out).stdout)
        raised = run("optimise", straight, "-o", out, "--order", 3)
        self.assertIn("curve the mesh on its CAD model", raised.stderr)

    def test_says_what_the_repair_did(self):
        folded, out = self.folder / "folded.msh", self.folder / "out.msh"
        folded.write_text(FOLDED)
        done = run("optimise", folded, "-o", out, "--repair", "split", "--json")
        self.assertEqual(done.returncode, 4, done.stderr)
        (left,) = json.loads(done.stdout)["repairs"]
        self.assertEqual(left["kind"], "left")
        self.assertIn("Only tetrahedra can be split", left["sentence"])
        done = run("optimise", folded, "-o", out, "--repair", "straighten")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertRegex(done.stdout, r"Made straight-sided|Left curved|can be made straight-sided")
        done = run("optimise", folded, "-o", out, "--repair", "split", "--region-below", "0.5")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("region_below", done.stderr)
        done = run("optimise", folded, "-o", out, "--repair", "refine")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("--repair refine needs a model", done.stderr)

    def test_ctrl_c_keeps_the_work_and_says_so(self):
        out = self.folder / "out.msh"
        process = start("optimise", LARGER, "-o", out, *ENDLESS, stdout=subprocess.PIPE)
        wait_for_line(process, "residual")
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertRegex(stderr, r"interrupted after \d+ iterations?; the best mesh so far is in")
        self.assertIn("stopped", stdout)
        self.assertTrue(out.exists())


class OnAServer(WithServer):
    def test_gives_the_same_bytes_as_without_a_server(self):
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        self.assertEqual(run("optimise", MESH, "-o", here).returncode, 0)
        done = self.remote("optimise", MESH, "-o", there)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(here.read_bytes(), there.read_bytes())

    def test_says_what_a_format_leaves_out_as_without_a_server(self):
        for optimise in (run, self.remote):
            done = optimise("optimise", MESH, "-o", self.folder / "out.su2")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("SU2's format has no place for curved sides", done.stderr)
            done = optimise("optimise", MESH, "-o", self.folder / "out.su2", "--quiet")
            self.assertNotIn("SU2", done.stderr)

    def test_ten_clients_at_once_get_the_same_bytes_as_one(self):
        alone = self.folder / "alone.msh"
        self.assertIn(run("optimise", LARGER, "-o", alone, "--max-iterations", 5, "--quiet").returncode, (0, 4))
        outs = [self.folder / f"{i}.msh" for i in range(10)]
        clients = [start("optimise", LARGER, "-o", out, "--max-iterations", 5, "--quiet", "--server", self.server.address,
                         stderr=subprocess.DEVNULL) for out in outs]
        for client in clients:
            self.assertIn(client.wait(50), (0, 4))
        for out in outs:
            self.assertEqual(out.read_bytes(), alone.read_bytes())

    def test_compression_does_not_change_the_result(self):
        plain, compressed = self.folder / "plain.msh", self.folder / "compressed.msh"
        for out, flags in ((plain, []), (compressed, ["--compress"])):
            done = self.remote("optimise", LARGER, "-o", out, "--max-iterations", "3", *flags)
            self.assertEqual(done.returncode, 4, done.stderr)
        self.assertEqual(plain.read_bytes(), compressed.read_bytes())

    def test_a_job_cancelled_by_someone_else_exits_with_1(self):
        process = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", self.server.address)
        wait_for_line(process, "residual")
        running = json.loads(self.remote("jobs", "--state", "running", "--json").stdout)["jobs"]
        for job in running:
            self.assertEqual(self.remote("cancel", job["job"]).returncode, 0)
        _, stderr = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 1, stderr)
        self.assertIn("someone else", stderr)

    def test_the_server_survives_bad_input(self):
        path = self.folder / "bad.msh"
        path.write_bytes(MESH.read_bytes()[:300])
        self.assertEqual(self.remote("optimise", path, "-o", self.folder / "out.msh").returncode, 3)
        self.assertEqual(self.remote("optimise", MESH, "-o", self.folder / "out.msh").returncode, 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
