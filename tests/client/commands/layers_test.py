"""varimesh layers: splits a thick layer at a wall; exit statuses, documents and refusals."""
import json
import math
import struct
import unittest

from programs import CASES, WithFolder, WithServer, run

# Two quadrilaterals of order 2 over a wall that bends; the wall is the group "wall".
WALL = [(0, 0), (0.25, 0.05), (0.5, 0.06), (0.75, 0.05), (1, 0)]


def thick():
    """A row of two quadrilaterals of order 2."""
    nodes = [(x, y + 0.5 * level) for level in range(3) for x, y in WALL]
    at = lambda i, j: 5 * j + i + 1
    elements = []
    for left in (0, 2):
        corners = [at(left, 0), at(left + 2, 0), at(left + 2, 2), at(left, 2)]
        edges = [at(left + 1, 0), at(left + 2, 1), at(left + 1, 2), at(left, 1)]
        elements.append((10, 1, corners + edges + [at(left + 1, 1)]))
        elements.append((8, 2, [at(left, 0), at(left + 2, 0), at(left + 1, 0)]))
    text = "".join(f"{n} {x} {y} 0\n" for n, (x, y) in enumerate(nodes, 1))
    lines = "".join(f"{n} {kind} 2 {group} {group} {' '.join(map(str, members))}\n"
                    for n, (kind, group, members) in enumerate(elements, 1))
    return (f'$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 2 "wall"\n2 1 "fluid"\n$EndPhysicalNames\n'
            f"$Nodes\n{len(nodes)}\n{text}$EndNodes\n$Elements\n{len(elements)}\n{lines}$EndElements\n")


class Layers(WithFolder):
    def setUp(self):
        super().setUp()
        self.mesh = self.folder / "thick.msh"
        self.mesh.write_text(thick())
        self.out = self.folder / "thin.msh"

    def split(self, *flags, wall="wall"):
        return run("layers", self.mesh, "--wall", wall, "-o", self.out, *flags)

    def test_splits_and_certifies(self):
        done = self.split("--layers", 5, "--first", 1e-3, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        document = json.loads(done.stdout)
        layers = document["layers"]
        self.assertEqual((layers["layers"], layers["elements_before"], layers["elements_after"]), (5, 2, 10))
        self.assertEqual(document["quality"]["certified"]["valid"], 10)
        self.assertAlmostEqual(layers["first_height"][0], 1e-3)
        judged = run("quality", self.out, "--certify", "--json")
        self.assertEqual(judged.returncode, 0, judged.stderr)
        self.assertEqual(json.loads(judged.stdout)["mesh"]["elements"], 10)

    def test_says_what_it_did(self):
        done = self.split("--heights", "1e-3,2e-3")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"(?m)^layers +2 above 2 wall elements, first height 0.001, growth 2, highest 0.002; "
                                      r"the rest of each thick cell is one more cell$")
        self.assertRegex(done.stdout, r"(?m)^elements +2 before, 6 after$")

    def test_takes_the_first_height_from_a_reynolds_number(self):
        done = self.split("--reynolds", 1e6, "--length", 2, "--y-plus", 3, "--layers", 8, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        height = 3 * 2 / (1e6 * math.sqrt(0.026 * 1e6 ** (-1 / 7) / 2))
        self.assertAlmostEqual(json.loads(done.stdout)["layers"]["first_height"][0] / height, 1, places=9)

    def test_splits_another_wall_of_its_result(self):
        self.assertEqual(self.split("--layers", 2, "--growth", 2).returncode, 0)
        again = self.folder / "again.msh"
        done = run("layers", self.out, "--wall", 2, "--layers", 3, "--growth", 1, "-o", again, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["layers"]["elements_after"], 8)

    def test_says_what_is_wrong(self):
        for flags, wall, status, sentence in (
                (("--layers", 3), "wall", 2, "Give two of the number of layers, the first height and the growth"),
                (("--layers", 3, "--first", 1), "wall", 3, "The layers do not fit at node 1 of the wall"),
                (("--layers", 3, "--growth", 2), "wing", 2, "There is no wall 'wing'. The mesh has these groups of boundary "
                                                          "elements: wall."),
                (("--layers", 3, "--growth", 2), "fluid", 2, "The group 'fluid' is no wall"),
                (("--heights", "1e-3,x"), "wall", 2, "--heights is '1e-3,x'; give numbers with commas between them"),
                (("--heights", "1e-3,-1"), "wall", 2, "A height of a layer is not a positive number"),
                (("--layers", 3, "--growth", 2, "--layer-spacing", "keep"), "wall", 2, "Choose even or graded"),
                (("--layers", 3, "--growth", 2, "--rows", 2), "wall", 3, "There is only 1 row of cells above the wall"),
                (("--layers", 3, "--first", -1), "wall", 2, "first is -1; give a length")):
            done = self.split(*flags, wall=wall)
            self.assertEqual(done.returncode, status, (flags, done.stderr))
            self.assertIn(sentence, done.stderr)
            self.assertFalse(self.out.exists())


class InARun(WithServer):
    """The same flags make a job split its result."""

    def setUp(self):
        super().setUp()
        self.mesh, self.out = self.folder / "thick.msh", self.folder / "thin.msh"
        self.mesh.write_text(thick())

    def optimise(self, *flags, command="optimise"):
        return run(command, self.mesh, "-o", self.out, "--wall", "wall", *flags)

    def test_gives_the_bytes_of_two_commands(self):
        first, second = self.folder / "first.msh", self.folder / "second.msh"
        self.assertEqual(run("optimise", self.mesh, "-o", first).returncode, 0)
        flags = ("--layers", 6, "--first", 1e-4, "--simplices")
        self.assertEqual(run("layers", first, "--wall", "wall", "-o", second, *flags).returncode, 0)
        for where in ((), ("--server", self.server.address)):
            with self.subTest(where=where):
                done = self.optimise(*flags, *where, "--json")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(self.out.read_bytes(), second.read_bytes())
                document = json.loads(done.stdout)
                self.assertEqual(document["layers"]["elements_after"], 24)
                self.assertEqual(document["mesh"]["elements"], 24)
                self.assertEqual(document["after"]["certified"]["valid"], 24)
                self.assertEqual(document["layers"]["thick"]["certified"]["valid"], 2)

    def test_the_spacing_is_that_of_the_new_layers(self):
        first, second = self.folder / "first.msh", self.folder / "second.msh"
        flags = ("--layers", 4, "--growth", 2, "--layer-spacing", "even")
        self.assertEqual(run("optimise", self.mesh, "-o", first).returncode, 0)
        self.assertEqual(run("layers", first, "--wall", "wall", "-o", second, *flags).returncode, 0)
        self.assertEqual(self.optimise(*flags).returncode, 0)
        self.assertEqual(self.out.read_bytes(), second.read_bytes())

    def test_the_summary_and_the_report_have_the_layers(self):
        report = self.folder / "report.html"
        done = self.optimise("--reynolds", 1e5, "--length", 1, "--layers", 5, "--report", report)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("high, where y+ is 1", done.stderr)
        self.assertRegex(done.stdout, r"(?m)^ +before +after +layers$")
        self.assertRegex(done.stdout, r"(?m)^layers +5 above 2 wall elements, first height")
        self.assertIn("5 above 2 wall elements", report.read_text())

    def test_a_job_that_is_submitted_has_them(self):
        job = self.remote("submit", self.mesh, "--wall", "wall", "--layers", 3, "--growth", 2).stdout.strip()
        self.assertEqual(self.remote("wait", job).returncode, 0)
        self.assertEqual(self.remote("result", job, "-o", self.out).returncode, 0)
        self.assertEqual(json.loads(run("quality", self.out, "--json").stdout)["mesh"]["elements"], 6)

    def test_grows_layers_where_there_are_none(self):
        done = run("optimise", CASES / "aerofoil_p4.msh", "-o", self.out, "--wall", "all", "--grow", 0.05, "--layers", 10,
                   "--first", 1e-5, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, "A layer of thickness 0.05 was grown on 44 elements of the wall. It has this thickness "
                                      "on [89][0-9.]+ % of their area. Elsewhere it is thinner, for want of room")
        layers = json.loads(done.stdout)["layers"]
        self.assertGreater(layers["full_share"], 0.8)
        self.assertAlmostEqual(layers["grown_thickness"][1], 0.05)
        self.assertEqual(layers["elements_after"], 520 + 44 * 10)
        self.assertEqual(run("quality", self.out, "--certify").returncode, 0)
        done = run("layers", self.mesh, "-o", self.out, "--wall", "wall", "--grow", 0.1, "--layers", 3, "--growth", 2)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, "(?m)^grown +0.1 thick; 100 % of the walls have the full thickness$")

    def test_the_files_mark_where_a_layer_that_grew_is_thinner(self):
        marked = self.folder / "marked.vtu"
        flags = ("--wall", "all", "--grow", 0.05, "--layers", 4, "--growth", 2)
        for command in (("optimise",), ("optimise", "--server", self.server.address), ("layers",)):
            with self.subTest(command=command):
                done = run(*command, CASES / "aerofoil_p4.msh", "-o", self.out, *flags)
                self.assertIn(done.returncode, (0, 4), done.stderr)
                head = b'$ElementData\n1\n"layer_thickness_share"\n1\n0\n3\n0\n1\n%d\n' % (44 * 4)
                section = self.out.read_bytes().split(head)[1].split(b"\n$EndElementData")[0]
                values = dict(struct.iter_unpack("<id", section))  # by the number of an element, in binary
                self.assertEqual(len(values), 44 * 4)
                self.assertLess(min(values.values()), 0.9)
                self.assertEqual(max(values.values()), 1)
                done = run(*command, CASES / "aerofoil_p4.msh", "-o", marked, *flags)
                self.assertIn(done.returncode, (0, 4), done.stderr)
                self.assertIn(b'Name="layer_thickness_share"', marked.read_bytes())

    def test_what_is_wrong_is_said_before_the_run(self):
        for flags, status, sentence in (
                (("--layers", 3), 2, "Give two of the number of layers"),
                (("--layers", 3, "--first", 1), 3, "The layers do not fit at node 1 of the wall"),
                (("--layers", 3, "--growth", 2, "--wall", "wing"), 2, "There is no wall 'wing'")):
            done = self.optimise(*flags)
            self.assertEqual(done.returncode, status, (flags, done.stderr))
            self.assertIn(sentence, done.stderr)
            self.assertNotIn("accuracy   ", done.stderr)
            self.assertFalse(self.out.exists())
        done = run("optimise", self.mesh, "-o", self.out, "--layers", 3)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--wall", done.stderr)


if __name__ == "__main__":
    unittest.main()
