"""From a CAD model to a certified curved mesh: 'varimesh mesh' and 'varimesh curve' on bodies with formulas, which Gmsh
makes. Skipped, with a word, without the program gmsh, its Python module, or the plugin that reads CAD files."""
import json
import math
import re
import subprocess
import unittest

from bodies import BODIES, certified, make, make_straight, need_gmsh
from geometry_test import distances
from programs import VARIMESH, WithFolder, run


def boundary_nodes(mesh, folder):
    """The coordinates of the nodes of all surface elements, as triples."""
    text = folder / "text.msh"
    subprocess.run([VARIMESH, "convert", mesh, text, "--format", "msh22"], check=True, capture_output=True)
    lines = iter(text.read_text().splitlines())
    nodes, used = {}, set()
    for line in lines:
        if line == "$Nodes":
            for _ in range(int(next(lines))):
                number, *x = next(lines).split()
                nodes[number] = tuple(map(float, x))
        if line == "$Elements":
            for _ in range(int(next(lines))):
                words = next(lines).split()
                if words[1] in ("21", "23", "9", "2"):  # triangles of order 3, 4, 2, 1
                    used.update(words[3 + int(words[2]):])
    return [nodes[number] for number in used]


def with_tags(mesh, path, tag_of):
    """The mesh in MSH 2.2, with tag_of(tag) in place of the tag of each surface element."""
    subprocess.run([VARIMESH, "convert", mesh, path, "--format", "msh22"], check=True, capture_output=True)
    lines = path.read_text().splitlines()
    for at in range(lines.index("$Elements") + 2, lines.index("$EndElements")):
        words = lines[at].split()
        if words[1] in ("2", "3"):
            words[3] = words[4] = str(tag_of(int(words[4])))
        lines[at] = " ".join(words)
    path.write_text("\n".join(lines) + "\n")


def nodes_of(mesh, folder):
    """The lines of all nodes, with every digit."""
    text = folder / "text.msh"
    subprocess.run([VARIMESH, "convert", mesh, text, "--format", "msh22"], check=True, capture_output=True)
    lines = text.read_text().splitlines()
    return sorted(lines[lines.index("$Nodes") + 2:lines.index("$EndNodes")])


class Curve(WithFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.msh"

    def test_one_command_goes_from_a_model_to_a_certified_mesh(self):
        for name, (body, distance) in BODIES.items():
            for ending, order in (("step", 3), ("brep", 4)):
                with self.subTest(model=name, order=order):
                    model = self.folder / f"{name}.{ending}"
                    make(body, model)
                    done = run("mesh", model, "--size", "0.5", "--per-turn", "10", "--order", order, "--repair",
                               "split", "--threads", "1", "-o", self.out)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    elements, valid = certified(done.stdout)
                    self.assertEqual(elements, valid)
                    self.assertNotIn("stay on straight sides", done.stderr)
                    nodes = boundary_nodes(self.out, self.folder)
                    self.assertGreater(len(nodes), 100)
                    self.assertLess(max(distance(*x) for x in nodes), 1e-9)
                    rms_before, rms_after, *_ = distances(done.stderr)
                    self.assertLessEqual(rms_after, rms_before)

    def test_curve_takes_a_straight_mesh_from_elsewhere(self):
        model, straight = self.folder / "plate.step", self.folder / "straight.msh"
        make(BODIES["plate"][0], model)
        make_straight(model, straight)
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(max(BODIES["plate"][1](*x) for x in boundary_nodes(self.out, self.folder)), 1e-9)
        self.assertLess(distances(done.stderr)[1], 1e-2)

        # A curved mesh is not curved again.
        done = run("curve", self.out, "--geometry", model, "--order", 4, "-o", self.folder / "again.msh")
        self.assertEqual(done.returncode, 3)
        self.assertIn("only a mesh of order 1 can be curved", done.stderr)
        self.assertFalse((self.folder / "again.msh").exists())
        done = run("curve", straight, "--geometry", model, "--order", 1, "-o", self.folder / "again.msh")
        self.assertEqual(done.returncode, 2)
        self.assertIn("from 2 to 10", done.stderr)

    def test_distances_that_were_not_measured_are_not_zero(self):
        make(BODIES["torus"][0], self.folder / "torus.step")
        straight = self.folder / "straight.msh"
        make_straight(self.folder / "torus.step", straight)
        done = run("curve", straight, "--geometry", self.folder / "torus.step", "--order", 3, "--time-limit", 0.001, "--json",
                   "-o", self.out)
        self.assertIn("Sliding was cut short", done.stderr)
        self.assertEqual(json.loads(done.stdout)["geometry"]["distance"], {"before": None, "after": None})

    def test_bodies_that_touch_get_one_mesh(self):
        wide = "occ.addCylinder(0, 0, 0, 0, 0, 1, 1); "
        bodies = {"of the same width": (wide + "occ.addCylinder(0, 0, 1, 0, 0, 1, 1)",
                                        lambda x, y, z: min(abs(math.hypot(x, y) - 1), abs(z), abs(z - 1), abs(z - 2))),
                  "one narrower": (wide + "occ.addCylinder(0, 0, 1, 0, 0, 1, 0.6)",
                                   lambda x, y, z: min(abs(math.hypot(x, y) - (1 if z < 1 else 0.6)), abs(z),
                                                       abs(z - 1), abs(z - 2)))}
        for name, (body, distance) in bodies.items():
            for ending in ("step", "brep"):
                with self.subTest(bodies=name, model=ending):
                    model = self.folder / f"two.{ending}"
                    make(body, model)
                    done = run("mesh", model, "--size", 0.5, "--order", 3, "--threads", 1, "-o", self.out)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    self.assertNotIn("stay on straight sides", done.stderr)
                    nodes = boundary_nodes(self.out, self.folder)
                    self.assertEqual(len({tuple(round(c, 9) for c in x) for x in nodes}), len(nodes))
                    self.assertLess(max(distance(*x) for x in nodes), 1e-9)
                    # In the middle of the face where they touch, too.
                    self.assertTrue([x for x in nodes if abs(x[2] - 1) < 1e-9 and math.hypot(x[0], x[1]) < 0.4])
        make(bodies["of the same width"][0], model)
        done = run("mesh", model, "--size", 0.5, "--order", 2, "--bodies", "separate", "-o", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        nodes = boundary_nodes(self.out, self.folder)
        self.assertLess(len({tuple(round(c, 9) for c in x) for x in nodes}), len(nodes))

    def test_the_face_where_bodies_touch_is_curved(self):
        # STEP repeats the face for each body; the mesh, of the model before that, has it once.
        whole, model, straight = (self.folder / name for name in ("two.brep", "two.step", "straight.msh"))
        body = "occ.fragment([(3, occ.addCylinder(0, 0, 0, 0, 0, 1, 1))], [(3, occ.addCylinder(0, 0, 1, 0, 0, 1, 1))])"
        make(body, whole)
        make(body, model)
        make_straight(whole, straight)
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("counted once", done.stderr)
        self.assertNotIn("stay on straight sides", done.stderr)
        nodes = boundary_nodes(self.out, self.folder)
        self.assertLess(max(min(abs(math.hypot(x, y) - 1), *(abs(z - at) for at in range(3))) for x, y, z in nodes),
                        1e-9)
        # Around the face where they touch, too: the middles of chords of this circle would be inside.
        self.assertLess(max(abs(math.hypot(x, y) - 1) for x, y, z in nodes if math.hypot(x, y) > 0.9), 1e-9)

    def test_one_tag_for_the_whole_boundary_is_enough(self):
        model, straight, one = self.folder / "plate.step", self.folder / "straight.msh", self.folder / "one.msh"
        make(BODIES["plate"][0], model)
        make_straight(model, straight)
        with_tags(straight, one, lambda tag: 1)
        done = run("curve", one, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("1 element by element", done.stderr)
        self.assertNotIn("stay", done.stderr)
        self.assertLess(max(BODIES["plate"][1](*x) for x in boundary_nodes(self.out, self.folder)), 1e-9)
        by_face = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(distances(done.stderr), distances(by_face.stderr))

    def test_tags_do_not_decide_where_nodes_go(self):
        model, straight, other = self.folder / "plate.step", self.folder / "straight.msh", self.folder / "other.msh"
        make(BODIES["plate"][0], model)
        make_straight(model, straight)
        found = {}
        for name, tag_of in (("each face", lambda tag: tag), ("permuted", lambda tag: 1 + tag % 7), ("others", lambda tag: 100 - tag),
                             ("one", lambda tag: 1)):
            with_tags(straight, other, tag_of)
            done = run("curve", other, "--geometry", model, "--order", 3, "--threads", 1, "-o", self.out)
            self.assertEqual(done.returncode, 0, done.stderr)
            found[name] = nodes_of(self.out, self.folder)
        self.assertGreater(len(found["one"]), 100)
        for name, nodes in found.items():
            self.assertEqual(nodes, found["each face"], name)

    def test_half_a_match_has_a_status_of_its_own(self):
        # The mesh is one of a plate with another, larger hole.
        other = BODIES["plate"][0].replace("0.4)", "0.5)")
        model, straight = self.folder / "plate.step", self.folder / "straight.msh"
        for body, path in ((other, model), (BODIES["plate"][0], self.folder / "own.step")):
            make(body, path)
        make_straight(self.folder / "own.step", straight)
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 6, done.stderr)
        self.assertRegex(done.stderr, r"varimesh: curved, but \d+ boundary elements stay straight\n")
        self.assertRegex(done.stderr, r"they lie on surfaces [\d, ]+ of the mesh\. The boundary is curved at \d+ elements")
        self.assertTrue(self.out.exists())
        stays = int(re.search(r"but (\d+) boundary elements stay", done.stderr)[1])
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out, "--json")
        self.assertEqual(json.loads(done.stdout)["geometry"]["straight_elements"], stays)

if __name__ == "__main__":
    need_gmsh()
    unittest.main(verbosity=2)
