"""Runs the recipes of deploy/workflows and the commands of docs/workflows.md with a real server."""
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

import support
from support import LARGER, MESH, SOURCE, VARIMESH, VARIMESHD, Server

RECIPES = SOURCE / "deploy" / "workflows"
PATH = os.pathsep.join([str(Path(VARIMESH).parent), str(Path(VARIMESHD).parent), os.environ["PATH"]])
NEEDS = {"Snakemake": ["snakemake", "gmsh"], "Page": ["snakemake", "gmsh", "cwltool"], "Recipes": [],
         "Many": ["snakemake", "cwltool", "dask-scheduler"]}


def varimesh(*arguments):
    done = subprocess.run([VARIMESH, *map(str, arguments)], capture_output=True, text=True, timeout=50)
    return done.returncode, done.stdout


class WithServer(support.WithFolder):
    def setUp(self):
        super().setUp()
        self.server = Server()
        self.addCleanup(self.server.stop)
        self.environment = {**os.environ, "PATH": PATH, "SERVER": self.server.address, "HOME": str(self.folder)}
        self.environment.pop("PYTHONPATH", None)

    def run_here(self, *command, **keywords):
        return subprocess.run(list(map(str, command)), cwd=self.folder, env=self.environment, text=True, timeout=100,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **keywords)

    def jobs(self):
        return json.loads(varimesh("jobs", "--server", self.server.address, "--json")[1])["jobs"]

    def quality(self, name):
        return json.loads(varimesh("quality", self.folder / name, "--json")[1])["quality"]


class Snakemake(WithServer):
    def workflow(self, *config, server=True):
        where = [f"server={self.server.address}"] if server else []
        return self.run_here("snakemake", "--cores", 1, "--snakefile", RECIPES / "Snakefile", "--config",
                             f"geometry={RECIPES / 'plate.geo'}", *where, *config)

    def test_goes_from_a_geometry_to_certified_files(self):
        done = self.workflow()
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertGreater(self.quality("mesh/curved.msh")["invalid_elements"], 0)
        after = self.quality("solver/plate.msh")
        document = json.loads((self.folder / "solver/plate.json").read_text())
        self.assertEqual(after["certified"]["valid"], document["mesh"]["elements"])
        self.assertIn(b"VTKFile", (self.folder / "solver/plate.vtu").read_bytes()[:200])
        for name in ("solver/plate.xml", "solver/plate.mesh"):
            own = self.quality(name)
            self.assertEqual(own["certified"]["valid"], document["mesh"]["elements"], name)
            self.assertAlmostEqual(own["min_scaled_jacobian"], after["min_scaled_jacobian"], places=9)
        self.assertEqual([job["state"] for job in self.jobs()], ["succeeded"])

        # Remove all outputs, as if the step had been lost. The server still has the job and makes no second one.
        whole = (self.folder / "solver/plate.msh").read_bytes()
        for left in [*self.folder.glob("solver/*"), *self.folder.glob("mesh/optimised.*")]:
            left.unlink()
        done = self.workflow()
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual((self.folder / "solver/plate.msh").read_bytes(), whole)
        self.assertEqual(len(self.jobs()), 1)

    def test_gives_the_solver_nothing_that_is_not_certified(self):
        done = self.workflow("options=--max-iterations 0", server=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("invalid", done.stdout)
        self.assertFalse(list(self.folder.glob("solver/*")))


class Page(WithServer):
    def test_commands_run_as_they_stand(self):
        (self.folder / "deploy").symlink_to(SOURCE / "deploy")
        shutil.copy(MESH, self.folder / "in.msh")
        blocks = re.findall(r"```sh\n(.*?)```", (SOURCE / "docs" / "workflows.md").read_text(), re.DOTALL)
        self.assertEqual(len(blocks), 6)
        script = "set -e\ntrap 'kill %1' EXIT\n" + "\n".join(blocks)
        done = self.run_here("bash", "-c", script)
        self.assertEqual(done.returncode, 0, done.stdout)
        for words in ("plate/solver/plate.vtu", "certified\n", "cwl/optimised.json"):
            self.assertIn(words, done.stdout)
        self.assertEqual(self.quality("plate/mesh/curved.msh")["invalid_elements"], 12)
        self.assertEqual(json.loads((self.folder / "cwl/optimised.json").read_text())["after"]["invalid_elements"], 0)


class Recipes(WithServer):
    def shell(self, *arguments, **environment):
        self.environment.update(environment)
        return self.run_here(RECIPES / "optimise.sh", *arguments).returncode

    def test_the_shell_s_statuses(self):
        out = self.folder / "out.msh"
        self.assertEqual(self.shell(MESH, out, "--energy", "winslow"), 0)
        self.assertEqual(self.quality("out.msh")["invalid_elements"], 0)
        self.assertEqual(self.shell(MESH, out, "--energy", "winslow"), 0)
        self.assertEqual(len(self.jobs()), 1)
        self.assertEqual(self.shell(MESH, out, "--max-iterations", 0), 4)
        bad = self.folder / "bad.msh"
        bad.write_text("solid cube\n")
        for refused in ((bad, out), (MESH, out, "--enrgy", "winslow"), (self.folder / "none", out), ()):
            self.assertEqual(self.shell(*refused), 3, refused)
        self.assertEqual(self.shell(MESH, out, SERVER="127.0.0.1:1", ATTEMPTS="1"), 5)

    def test_the_shell_that_was_killed_joins_its_job(self):
        options = ["--method", "sweeps", "--tolerance", "1e-15", "--max-iterations", "150"]
        command = [str(RECIPES / "optimise.sh"), str(LARGER), "out.msh", *options]
        first = subprocess.Popen(command, cwd=self.folder, env=self.environment, start_new_session=True)
        deadline = time.monotonic() + 20
        while not self.jobs() and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
        self.assertIn(self.shell(LARGER, "out.msh", *options), (0, 4))
        self.assertEqual(len(self.jobs()), 1)
        self.assertTrue((self.folder / "out.msh").exists())

    def test_a_deleted_job_frees_its_request_id(self):
        once = ("submit", MESH, "--server", self.server.address, "--request-id", "once")
        job = varimesh(*once)[1].strip()
        self.assertEqual(varimesh("watch", job, "--server", self.server.address)[0], 0)
        self.assertEqual(varimesh(*once)[1].strip(), job)
        self.assertEqual(varimesh("delete", job, "--server", self.server.address)[0], 0)
        self.assertNotEqual(varimesh(*once)[1].strip(), job)

    def test_optimise_takes_a_request_id(self):
        again = ("optimise", MESH, "-o", self.folder / "a.msh", "--server", self.server.address, "--request-id", "x")
        self.assertEqual([varimesh(*again)[0], varimesh(*again)[0]], [0, 0])
        self.assertEqual(len(self.jobs()), 1)

    def test_the_airflow_recipe_compiles(self):
        for recipe in ("airflow_dag.py", "many/airflow_many_dag.py"):
            compile((RECIPES / recipe).read_text(), recipe, "exec")


class Many(WithServer):
    """Each recipe for many meshes, with six of them."""

    def setUp(self):
        super().setUp()
        (self.folder / "meshes").mkdir()
        for number in range(6):
            shutil.copy(MESH, self.folder / "meshes" / f"mesh{number}.msh")
        self.meshes = sorted((self.folder / "meshes").iterdir())

    def assert_all_certified(self, folder):
        results = sorted((self.folder / folder).glob("*.msh"))
        self.assertEqual([path.name for path in results], [path.name for path in self.meshes])
        for path in results:
            self.assertEqual(varimesh("quality", path, "--certify")[0], 0)
        self.assertEqual({job["state"] for job in self.jobs()}, {"succeeded"})
        self.assertEqual(len(self.jobs()), 6)

    def test_snakemake(self):
        command = ("snakemake", "--cores", 2, "--snakefile", RECIPES / "many" / "Snakefile", "--config",
                   f"meshes={self.folder / 'meshes'}", f"server={self.server.address}")
        done = self.run_here(*command)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assert_all_certified("results")
        self.assertEqual(len((self.folder / "results.txt").read_text().splitlines()), 6)
        shutil.rmtree(self.folder / "results")
        shutil.rmtree(self.folder / "jobs")
        (self.folder / "results.txt").unlink()
        self.assertEqual(self.run_here(*command).returncode, 0)
        self.assert_all_certified("results")  # and there are still six jobs
        # With other options, the results are others. A mesh that is gone is left out.
        self.meshes.pop().unlink()
        (self.folder / "results.txt").unlink()
        shutil.rmtree(self.folder / "jobs")
        done = self.run_here(*command, "options=--energy winslow")
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual(len(list((self.folder / "results").glob("*.msh"))), 5)
        self.assertEqual(len(self.jobs()), 11)

    def test_cwl(self):
        meshes = [word for mesh in self.meshes for word in ("--meshes", mesh)]
        done = self.run_here("cwltool", "--quiet", "--parallel", "--no-container", "--preserve-environment", "PATH",
                             "--outdir", "out", RECIPES / "many" / "many.cwl", "--server", self.server.address, *meshes)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assert_all_certified("out")

    def test_dask(self):
        self.environment["PYTHONPATH"] = str(Path(VARIMESH).parent / "python" / "package")
        for _ in range(2):  # The second time, every task joins the job that there is.
            done = self.run_here(sys.executable, RECIPES / "many" / "dask_many.py", self.server.address, "out", *self.meshes)
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertEqual(done.stdout.count("certified valid"), 6)
            self.assert_all_certified("out")


if __name__ == "__main__":
    missing = [name for name in NEEDS.get(sys.argv[1], []) if not shutil.which(name)]
    if missing:
        support.skip(f"{', '.join(missing)} missing (deploy/setup test)")
    unittest.main(verbosity=2)
