"""From a CAD model to a certified curved mesh: 'varimesh mesh' and 'varimesh curve' on bodies with formulas, which Gmsh
makes. Skipped, with a word, without the program gmsh, its Python module, or the plugin that reads CAD files."""
import contextlib
import json
import math
import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
import unittest
from pathlib import Path

from geometry_test import distances, gmsh_python
from programs import CASES, VARIMESH, WithFolder, run, start

# The distance of a point to the boundary of each body.
BODIES = {
    "sphere": ("occ.addSphere(0, 0, 0, 1)", lambda x, y, z: abs(math.hypot(x, y, z) - 1)),
    "cylinder": ("occ.addCylinder(0, 0, 0, 0, 0, 2, 1)",
                 lambda x, y, z: min(abs(math.hypot(x, y) - 1), abs(z), abs(z - 2))),
    "torus": ("occ.addTorus(0, 0, 0, 1, 0.4)", lambda x, y, z: abs(math.hypot(math.hypot(x, y) - 1, z) - 0.4)),
    "plate": ("occ.cut([(3, occ.addBox(-1, -1, 0, 2, 2, 0.5))], [(3, occ.addCylinder(0, 0, 0, 0, 0, 0.5, 0.4))])",
              lambda x, y, z: min(abs(math.hypot(x, y) - 0.4), abs(abs(x) - 1), abs(abs(y) - 1), abs(z),
                                  abs(z - 0.5))),
}

MAKE = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
{body}
occ.synchronize()
gmsh.write(sys.argv[1])
"""

STRAIGHT = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.merge(sys.argv[1])
gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
gmsh.option.setNumber("Mesh.MeshSizeMin", 0.7)
gmsh.option.setNumber("Mesh.SaveAll", 1)
gmsh.model.mesh.generate(3)
gmsh.write(sys.argv[2])
"""


def make(body, path):
    subprocess.run([PYTHON, "-c", MAKE.format(body=body), str(path)], check=True, capture_output=True)


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


def certified(text):
    """How many elements there are, and how many are certified valid after the run."""
    elements = int(re.search(r"(\d+) elements", text).group(1))
    return elements, int(re.search(r"certified valid\s+\d+\s+(\d+)", text).group(1))


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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(model), str(straight)], check=True, capture_output=True)
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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(self.folder / "torus.step"), str(straight)], check=True, capture_output=True)
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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(whole), str(straight)], check=True, capture_output=True)
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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(model), str(straight)], check=True, capture_output=True)
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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(model), str(straight)], check=True, capture_output=True)
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
        subprocess.run([PYTHON, "-c", STRAIGHT, str(self.folder / "own.step"), str(straight)], check=True,
                       capture_output=True)
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 6, done.stderr)
        self.assertRegex(done.stderr, r"varimesh: curved, but \d+ boundary elements stay straight\n")
        self.assertRegex(done.stderr, r"they lie on surfaces [\d, ]+ of the mesh\. The boundary is curved at \d+ elements")
        self.assertTrue(self.out.exists())
        stays = int(re.search(r"but (\d+) boundary elements stay", done.stderr)[1])
        done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out, "--json")
        self.assertEqual(json.loads(done.stdout)["geometry"]["straight_elements"], stays)

    def test_a_mesh_is_no_model(self):
        done = run("mesh", CASES / "disc_p4.msh", "--size", 0.5, "--order", 3, "-o", self.out)
        self.assertEqual(done.returncode, 3)
        self.assertIn("is a mesh already", done.stderr)
        self.assertNotIn("Gmsh makes", done.stderr)

    def test_without_gmsh_there_is_a_sentence(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out,
                   env={**os.environ, "PATH": str(self.folder)})
        self.assertEqual(done.returncode, 2)
        self.assertIn("'gmsh', which makes the straight mesh, is not in PATH", done.stderr)
        self.assertFalse(self.out.exists())

    def fake_gmsh(self, script):
        fake = self.folder / "gmsh"
        fake.write_text("#!/bin/sh\n" + script)
        fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
        return {**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}"}

    def test_what_gmsh_prints_is_shown_if_it_fails(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        for script, sentence in (("echo 'Error: no such luck' >&2; exit 7", "ended with status 7"),
                                 ("echo 'Error: no such luck'; kill -SEGV $$", "was ended by signal 11"),
                                 ("echo 'Error: no such luck'", "wrote no mesh")):
            done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out, env=self.fake_gmsh(script))
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(sentence, done.stderr)
            self.assertIn("It printed: Error: no such luck\n", done.stderr)
            self.assertFalse(self.out.exists())

    def test_pieces_that_gmsh_cannot_write_are_missed(self):
        model = self.folder / "boxes.step"
        make("occ.addBox(0, 0, 0, 1, 1, 1); occ.addBox(1, 0, 0, 1, 1, 1)", model)
        found = shutil.which("gmsh")
        # gmsh itself meshes the pieces, and whatever it has written of them is gone.
        env = self.fake_gmsh(f'{found} "$@"\nend=$?\nrm "$(dirname "$1")/pieces.brep" || exit 9\nexit $end\n')
        done = run("mesh", model, "--size", 0.7, "--order", 2, "-o", self.out, env=env)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("could not write the pieces", done.stderr)
        self.assertFalse(self.out.exists())
        make(BODIES["sphere"][0], model)  # there is nothing to cut
        env = self.fake_gmsh(f'exec {found} "$@"\n')
        done = run("mesh", model, "--size", 0.7, "--order", 2, "-o", self.out, env=env)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_first_errors_of_gmsh_are_shown_and_not_its_footer(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        footer = ["-" * 30, "Mesh generation error summary", "    0 warnings", "    2 errors",
                  "Check the full log for details", "-" * 30]
        said = ["Invalid boundary mesh (overlapping facets) on surface 42 surface 44", "No elements in volume 1"]
        script = "".join(f"echo 'Error   : {line}'\n" for line in said + footer) + "exit 1\n"
        done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out, env=self.fake_gmsh(script))
        self.assertEqual(done.returncode, 3)
        self.assertIn("It printed: " + " | ".join("Error   : " + line for line in said) + "\n", done.stderr)

    def test_after_an_error_of_gmsh_it_says_what_to_do(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        for error, advice in (("Invalid boundary mesh (overlapping facets) on surface 42 surface 44", "half the --size"),
                              ("1D mesh not forming a closed loop", "close it in the program that made the model"),
                              ("BooleanFragments failed", "--bodies separate"), ("No such luck", "export it again")):
            done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out,
                       env=self.fake_gmsh(f"echo 'Error   : {error}'\nexit 1\n"))
            self.assertEqual(done.returncode, 3)
            self.assertIn(advice, done.stderr)

    def test_models_without_a_body_that_cannot_be_meshed_are_refused(self):
        model = self.folder / "model.step"
        for body, sentence in (("occ.addCircle(0, 0, 0, 1)", "Export the model as solids or surfaces."),
                               ("occ.extrude([(1, occ.addCircle(0, 0, 0, 1))], 0, 0, 2)", "Close the faces of the model to a body")):
            make(body, model)
            done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(sentence, done.stderr)

    def test_errors_of_gmsh_name_the_model(self):
        model = self.folder / "a sphere"  # without an ending
        make(BODIES["sphere"][0], self.folder / "sphere.step")
        shutil.copy(self.folder / "sphere.step", model)
        script = "echo \"Error   : '$1', line 2: no model.step\"\nexit 1\n"
        for bodies in ("joined", "separate"):
            done = run("mesh", model, "--size", 0.5, "--order", 3, "--bodies", bodies, "-o", self.out,
                       env=self.fake_gmsh(script))
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(f"It printed: Error   : '{model}', line 2: no {model}\n", done.stderr)
            done = run("mesh", model, "--size", 0.5, "--order", 2, "--bodies", bodies, "-o", self.out)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_name_of_a_model_is_no_command_of_gmsh(self):
        model = self.folder / 'a.";SystemCall "touch has-run'
        make(BODIES["sphere"][0], self.folder / "sphere.step")
        shutil.copy(self.folder / "sphere.step", model)
        done = run("mesh", model, "--size", 0.5, "--order", 2, "-o", self.out, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertFalse((self.folder / "has-run").exists())

    def test_gmsh_is_part_of_the_time_limit_and_says_what_it_does(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        environment = self.fake_gmsh("echo 'Info    : Meshing surface 3 (Sphere)'\nexec sleep 60\n")
        begun = time.monotonic()
        done = run("mesh", model, "--size", 0.5, "--order", 3, "--time-limit", 3, "-o", self.out, env=environment)
        self.assertLess(time.monotonic() - begun, 30)  # gmsh would take 60 s
        self.assertEqual(done.returncode, 3)
        self.assertIn("Gmsh: Meshing surface 3 (Sphere)\n", done.stderr)
        self.assertIn("after 3 s, the time limit. It was still at: Meshing surface 3 (Sphere).", done.stderr)
        self.assertIn("look whether the model crosses itself there", done.stderr)
        self.assertFalse(self.out.exists())

    def test_the_plugin_is_looked_for_before_gmsh_runs(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        plugin = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
        (self.folder / plugin.name).symlink_to(plugin)  # without the program that reads files
        environment = self.fake_gmsh(f"touch {self.folder}/has-run")
        for path, word in ((self.folder / "none.so", "without OpenCASCADE"),
                           (self.folder / plugin.name, "varimesh_cad_reader")):
            done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out,
                       env={**environment, "VARIMESH_OPENCASCADE": str(path)})
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(word, done.stderr)
            self.assertFalse((self.folder / "has-run").exists())
        found = json.loads(run("doctor", "--json", env={**os.environ, "VARIMESH_OPENCASCADE":
                                                        str(self.folder / plugin.name)}).stdout)
        self.assertIn("varimesh_cad_reader", found["CAD plugin"]["wrong"])

    def test_messages_and_the_report_name_the_model_and_no_temporary_file(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        for content in ("nonsense", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n"):
            script = f"for last; do :; done\nprintf '{content}' > \"$last\"\n"
            done = run("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out, env=self.fake_gmsh(script))
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn("sphere.step", done.stderr)
            self.assertNotIn("sphere.msh", done.stderr)
            self.assertFalse(self.out.exists())
        page = self.folder / "page.html"
        done = run("mesh", model, "--size", 0.5, "--order", 2, "-o", self.out, "--report", page, "--threads", 1)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("sphere.msh", done.stdout + done.stderr)
        text = page.read_text()
        self.assertTrue("sphere.step" in text and "sphere.msh" not in text)

    def test_an_interrupt_ends_gmsh_too(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        number = self.folder / "number"
        environment = self.fake_gmsh(f"echo $$ > {number}.tmp; mv {number}.tmp {number}; exec sleep 60")
        process = start("mesh", model, "--size", 0.5, "--order", 3, "-o", self.out, env=environment)
        deadline = time.monotonic() + 20
        while not number.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        child = int(number.read_text())
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(20), 130)
        process.stderr.close()
        self.assertFalse(Path(f"/proc/{child}").exists())
        self.assertFalse(self.out.exists())

    def test_an_interrupt_during_the_work_on_the_model_ends_the_command(self):
        model, straight = self.folder / "sphere.step", self.folder / "straight.msh"
        make(BODIES["sphere"][0], model)
        subprocess.run([PYTHON, "-c", STRAIGHT, str(model), str(straight)], check=True, capture_output=True)
        # A reader that does not end stands for a model that takes long.
        plugin = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
        (self.folder / plugin.name).symlink_to(plugin)
        number, reader = self.folder / "number", self.folder / "varimesh_cad_reader"
        reader.write_text(f"#!/bin/sh\necho $$ > {number}.tmp; mv {number}.tmp {number}; exec sleep 60\n")
        reader.chmod(0o755)
        process = start("curve", straight, "--geometry", model, "--order", 3, "-o", self.out,
                        env={**os.environ, "VARIMESH_OPENCASCADE": str(self.folder / plugin.name)})
        deadline = time.monotonic() + 20
        while not number.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(20), 130)
        process.stderr.close()
        self.assertFalse(self.out.exists())
        with contextlib.suppress(ProcessLookupError):  # it has ended with the job
            os.kill(int(number.read_text()), signal.SIGKILL)

    def test_a_file_on_which_the_reader_crashes_is_refused(self):
        model = self.folder / "sphere.step"
        make(BODIES["sphere"][0], model)
        plugin = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
        (self.folder / plugin.name).symlink_to(plugin)
        reader = self.folder / "varimesh_cad_reader"
        straight = self.folder / "straight.msh"
        subprocess.run([PYTHON, "-c", STRAIGHT, str(model), str(straight)], check=True, capture_output=True)
        for script, status, sentence in (("kill -SEGV $$", 3, "OpenCASCADE crashed while it read it (signal 11)"),
                                         ("kill -XCPU $$", 3, "took more than"),
                                         ("printf 'it is damaged.' >&4; exit 3", 3, "it is damaged."),
                                         ("exit 9", 3, "ended with status 9")):
            reader.write_text("#!/bin/sh\n" + script + "\n")
            reader.chmod(0o755)
            done = run("curve", straight, "--geometry", model, "--order", 3, "-o", self.out,
                       env={**os.environ, "VARIMESH_OPENCASCADE": str(self.folder / plugin.name)})
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertIn(sentence, done.stderr)
            self.assertFalse(self.out.exists())


if __name__ == "__main__":
    PYTHON = gmsh_python()
    if PYTHON is None or not (Path(VARIMESH).parent / "libvarimesh_opencascade.so").exists() or not shutil.which("gmsh"):
        print("skipped: there is no program or Python module gmsh, or VariMesh was built without OpenCASCADE")
        sys.exit(77)
    unittest.main(verbosity=2)
