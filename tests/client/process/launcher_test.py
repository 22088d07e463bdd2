"""The command as one of several processes that mpirun, mpiexec or srun started. It refuses, because each process would do
the whole work and write the same files."""
import os
import shutil
import subprocess
import sys
import unittest

from programs import MESH, VARIMESH, WithFolder, run

USAGE = 2
# Open MPI starts several processes on one core, and as root, only if it is told so.
PERMITTED = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
             "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}  # Open MPI 5
LAUNCHERS = {"mpirun": ["-n"], "mpiexec": ["-n"], "srun": ["--overcommit", "-n"]}
PREFIXES = ("OMPI_", "PMI", "MV2_", "SLURM_")


def alone():
    """The environment without anything of a launcher."""
    return {name: value for name, value in os.environ.items() if not name.startswith(PREFIXES)}


class Cases(WithFolder):
    def optimise(self):
        return ["optimise", MESH, "-o", self.folder / "out.msh", "--report", self.folder / "report.html"]

    def assert_refused(self, done, *words):
        self.assertEqual(done.returncode, USAGE, done.stderr)
        for word in ("varimesh-mpi", "Start one process", *words):
            self.assertIn(word, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual(list(self.folder.iterdir()), [])


class MadeEnvironments(Cases):
    def command(self, *arguments, **environment):
        return run(*arguments, env={**alone(), **environment})

    def test_several_processes_are_refused(self):
        for environment in (
                {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0", "PMIX_RANK": "0"},  # mpirun
                {"PMI_SIZE": "4", "PMI_RANK": "3"},                                            # mpiexec of MPICH
                {"MV2_COMM_WORLD_SIZE": "4", "MV2_COMM_WORLD_RANK": "0"},
                {"SLURM_NTASKS": "4", "SLURM_PROCID": "0", "SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "4"},
                # Two processes of mpirun, which started them within a step of one task.
                {"OMPI_COMM_WORLD_SIZE": "2", "SLURM_STEP_NUM_TASKS": "1", "SLURM_STEP_ID": "0"},
                {"PMIX_RANK": "1", "PMIX_NAMESPACE": "prun-1"}):
            with self.subTest(environment):
                self.assert_refused(self.command(*self.optimise(), **environment))

    def test_the_sentence_names_what_told_and_how_to_start_one_process(self):
        step = self.command("quality", MESH, SLURM_STEP_ID="0", SLURM_STEP_NUM_TASKS="4", SLURM_PROCID="2")
        self.assert_refused(step, "SLURM_STEP_NUM_TASKS is 4", "srun -n 1")
        mpi = self.command("quality", MESH, OMPI_COMM_WORLD_SIZE="3")
        self.assert_refused(mpi, "OMPI_COMM_WORLD_SIZE is 3", "mpirun -n 1")

    def test_one_process_goes_on(self):
        for environment in (
                {},
                {"SLURM_NTASKS": "4", "SLURM_PROCID": "0", "SLURM_JOB_ID": "17"},  # a batch script
                {"SLURM_NTASKS": "1", "SLURM_PROCID": "0", "SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "1"},
                {"OMPI_COMM_WORLD_SIZE": "1", "OMPI_COMM_WORLD_RANK": "0", "PMIX_RANK": "0"},
                # mpirun -n 1 in a job of Slurm: its daemons are a step of four tasks.
                {"OMPI_COMM_WORLD_SIZE": "1", "SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "4"},
                {"PMI_SIZE": "many"}, {"PMI_SIZE": ""}):
            with self.subTest(environment):
                done = self.command("quality", MESH, **environment)
                self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_what_tells_about_the_program_is_answered_to_each_process(self):
        for arguments in (["--version"], ["--help"], ["quality", "--help"], ["man", "quality"], ["completion", "bash"]):
            with self.subTest(arguments):
                self.assertEqual(self.command(*arguments, OMPI_COMM_WORLD_SIZE="4").returncode, 0)


class RealLaunchers(Cases):
    def launch(self, processes, *arguments):
        for launcher in filter(shutil.which, LAUNCHERS):
            with self.subTest(launcher):
                yield subprocess.run([launcher, *LAUNCHERS[launcher], str(processes), VARIMESH, *map(str, arguments)],
                                     capture_output=True, text=True, timeout=50, env={**alone(), **PERMITTED})

    def test_several_processes_are_refused(self):
        for done in self.launch(3, *self.optimise()):
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("varimesh-mpi", done.stderr)
            self.assertEqual(list(self.folder.iterdir()), [])

    def test_one_process_goes_on(self):
        for done in self.launch(1, *self.optimise()):
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.folder / "out.msh").exists())


if __name__ == "__main__":
    if sys.argv[1] == "RealLaunchers" and not any(map(shutil.which, LAUNCHERS)):
        print("SKIPPED: there is neither mpirun nor srun (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
