"""What 'varimesh mesh' and 'varimesh curve' do if the program gmsh, the model or its reader fails: they say what happened, and
leave no process behind. Skipped, with a word, without the program gmsh, its Python module, or the plugin that reads CAD files."""
import contextlib
import json
import os
import shutil
import signal
import stat
import time
import unittest
from pathlib import Path

from bodies import BODIES, make, make_straight, need_gmsh
from programs import CASES, VARIMESH, WithFolder, run, start


class Gmsh(WithFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.msh"

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
        make_straight(model, straight)
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
        make_straight(model, straight)
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
    need_gmsh()
    unittest.main(verbosity=2)
