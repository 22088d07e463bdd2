"""varimesh quality: documents, exit statuses, and the marks of unrepairable elements."""
import json
import os
import subprocess
import unittest

from programs import FOLDED, MESH, VARIMESH, WithFolder, clockwise, run


class Quality(WithFolder):
    def test_prints_a_table_or_one_document(self):
        done = run("quality", MESH, "--json", "--lattice", 12)
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        self.assertEqual(list(document), ["mesh", "quality", "unrepairable", "left"])
        self.assertEqual([one["answer"] for one in document["quality"]["uncertified"]], ["invalid", "invalid"])
        self.assertEqual(document["quality"]["invalid_elements"], 2)
        self.assertEqual(document["quality"]["lattice_intervals"], 12)
        self.assertEqual(len(document["quality"]["invalid"]), 2)
        self.assertGreater(document["quality"]["accuracy"]["loss"], 0)
        self.assertEqual(len(document["quality"]["accuracy"]["modal_parts"]), document["mesh"]["order"] - 1)
        self.assertIn("loss of accuracy ", run("quality", MESH).stdout)
        self.assertIn("invalid", run("quality", MESH).stdout)

    def test_exits_with_4_if_an_element_is_not_certified(self):
        self.assertEqual(run("quality", MESH).returncode, 0)
        done = run("quality", MESH, "--certify")
        self.assertEqual((done.returncode, done.stderr), (4, "varimesh: 2 elements are invalid\n"))
        out = self.folder / "out.msh"
        self.assertEqual(run("optimise", MESH, "-o", out, "--until", "valid", "--quiet").returncode, 0)
        self.assertEqual(run("quality", out, "--certify").returncode, 0)

    def test_counts_an_element_that_is_invalid_only_between_its_samples(self):
        # J is -0.017 in a small region of the triangle, and at least 0.005 on a lattice of 8 intervals per edge.
        folded = self.folder / "between.msh"
        nodes = ((0, 0), (1, 0), (0, 1), (0.28, 0.28), (0.8, 0.76), (-0.04, 0.31))
        lines = "".join(f"{i} {x} {y} 0\n" for i, (x, y) in enumerate(nodes, 1))
        folded.write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n{lines}$EndNodes\n"
                          "$Elements\n1\n1 9 2 1 1 1 2 3 4 5 6\n$EndElements\n")
        done = run("quality", folded, "--certify")
        self.assertEqual((done.returncode, done.stderr), (4, "varimesh: 1 element is invalid\n"))
        for row in (r"invalid elements +0", r"certified valid +0", r"certified invalid +1", r"undecided +0"):
            self.assertRegex(done.stdout, rf"(?m)^{row}$")
        done = run("optimise", folded, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 4)
        self.assertRegex(done.stdout, r"(?m)^certified invalid +1 +1$")

    def test_judges_a_mesh_whose_elements_are_inverted_with_straight_sides(self):
        # With node 1 just on the other side, the first triangle is inverted even with straight sides.
        inverted = self.folder / "inverted.msh"
        inverted.write_text(FOLDED.replace("\n1 0 0 0\n", "\n1 0.6 0.6 0\n"))
        done = run("optimise", inverted, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertIn("element 1 is inverted or nearly flat", done.stdout)
        named = json.loads(run("optimise", inverted, "-o", self.folder / "out.msh", "--json", "--quiet").stdout)
        self.assertEqual(named["substitute_targets"]["count"], 1)
        self.assertEqual(named["substitute_targets"]["elements"], [1])
        usual = json.loads(run("optimise", MESH, "-o", self.folder / "out.msh", "--json", "--quiet").stdout)
        self.assertNotIn("substitute_targets", usual)
        done = run("quality", inverted, "--certify", "--diagnose")
        self.assertEqual(done.returncode, 4, done.stderr)

    def test_judges_clockwise_elements_as_if_they_were_turned(self):
        mirrored = self.folder / "mirrored.msh"
        usual = json.loads(run("quality", MESH, "--json").stdout)["quality"]
        self.assertEqual((usual["clockwise_elements"], usual["clockwise"]), (0, []))
        for elements, sentence in (([9, 14], "2 elements are numbered clockwise: elements 9 and 14; "),
                                   ([11], "Element 11 is numbered clockwise; "),
                                   (list(range(8, 17)), "All 9 elements are numbered clockwise; ")):
            mirrored.write_text(clockwise(MESH, elements))
            self.assertIn(sentence + "'varimesh convert --orient' turns", run("quality", mirrored).stdout)
            judged = json.loads(run("quality", mirrored, "--json").stdout)["quality"]
            self.assertEqual((judged.pop("clockwise_elements"), judged.pop("clockwise")), (len(elements), elements))
            self.assertEqual(judged, {key: value for key, value in usual.items() if not key.startswith("clockwise")})

    def test_judges_a_surface_in_space(self):
        surface, out = self.folder / "surface.msh", self.folder / "out.msh"
        surface.write_text(FOLDED.replace("\n4 1 1 0\n", "\n4 1 1 0.3\n"))
        done = run("quality", surface, "--certify", "--diagnose")
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertIn("surface in space of order 2: 2 elements, 9 nodes; each element is judged along its normal", done.stdout)
        self.assertIn("element 1 is invalid: ", done.stdout)
        self.assertIn("Mesh the boundary anew or refine it: nothing else is known to help element 1.\n", done.stdout)
        judged = json.loads(run("quality", surface, "--json").stdout)
        self.assertEqual((judged["mesh"]["free_nodes"], judged["quality"]["is_surface"]), (0, True))
        self.assertEqual([one["number"] for one in judged["quality"]["uncertified"]], [1])
        self.assertNotIn("accuracy", judged["quality"])
        self.assertEqual(run("quality", surface, "-o", self.folder / "marked.vtu").returncode, 0)
        self.assertIn(b"certified", (self.folder / "marked.vtu").read_bytes())
        done = run("quality", surface, "--report", self.folder / "report.html")
        self.assertEqual(done.returncode, 3)
        self.assertIn("Leave out --report", done.stderr)
        done = run("optimise", surface, "-o", out)
        self.assertEqual(done.returncode, 3)
        self.assertIn("give the model as the geometry", done.stderr)
        self.assertIn("only the quality of the mesh can be judged", done.stderr)
        self.assertFalse(out.exists())

    def test_judges_a_mesh_of_any_plane_as_in_its_plane(self):
        flat, upright = self.folder / "flat.msh", self.folder / "upright.msh"
        head, _, rest = FOLDED.partition("$Nodes\n")
        nodes, end, tail = rest.partition("$EndNodes")
        count, *lines = nodes.splitlines()
        fields = [line.split() for line in lines]
        flat.write_text(FOLDED)
        upright.write_text(head + "$Nodes\n" + "\n".join([count, *(f"{n} {x} 3 {y}" for n, x, y, _ in fields)]) + "\n" + end + tail)
        in_plane, in_space = (json.loads(run("quality", mesh, "--json").stdout) for mesh in (flat, upright))
        self.assertFalse(in_space["quality"]["is_surface"])
        self.assertEqual(in_space["mesh"], in_plane["mesh"])
        self.assertEqual(in_space["quality"], in_plane["quality"])
        self.assertIn("2-D mesh of order 2", run("quality", upright).stdout)
        self.assertEqual(run("quality", upright, "--report", self.folder / "report.html").returncode, 0)
        marked = self.folder / "marked.msh"
        self.assertEqual(run("quality", upright, "-o", marked).returncode, 0)
        self.assertEqual(run("quality", marked, "--json").stdout, run("quality", upright, "--json").stdout)

    def test_ends_quietly_if_the_reader_has_seen_enough(self):
        ours, theirs = os.pipe()
        os.close(ours)
        for flags, status in (([], 0), (["--certify"], 4)):
            done = subprocess.run([VARIMESH, "quality", MESH, *flags], stdout=theirs, stderr=subprocess.PIPE)
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertNotIn(b"standard output", done.stderr)
        os.close(theirs)

    def test_says_and_marks_what_cannot_be_repaired(self):
        folded, marked = self.folder / "folded.msh", self.folder / "marked.msh"
        folded.write_text(FOLDED)
        done = run("quality", folded, "--diagnose", "-o", marked)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"triangle 1: .*refine it")
        self.assertIn('"unrepairable"', marked.read_text())


if __name__ == "__main__":
    unittest.main(verbosity=2)
