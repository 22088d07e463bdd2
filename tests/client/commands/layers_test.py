"""varimesh layers: splits a thick layer at a wall; exit statuses, documents and refusals."""
import json
import math
import unittest

from programs import WithFolder, run

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
                                      r"what was left of the thick cells is one more cell$")
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
                (("--heights", "1e-3,x"), "wall", 2, "--heights has 'x', which is no number"),
                (("--layers", 3, "--growth", 2, "--rows", 2), "wall", 3, "There is only 1 row of cells above the wall"),
                (("--layers", 3, "--first", -1), "wall", 2, "--first")):
            done = self.split(*flags, wall=wall)
            self.assertEqual(done.returncode, status, (flags, done.stderr))
            self.assertIn(sentence, done.stderr)
            self.assertFalse(self.out.exists())


if __name__ == "__main__":
    unittest.main()
