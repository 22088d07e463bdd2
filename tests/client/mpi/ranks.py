"""What the tests of varimesh-mpi share: launching it, and meshes that it reads."""
import os
import shutil
import struct
import subprocess
import sys
import time
import unittest

from programs import CASES, WithFolder, run

VARIMESH_MPI = os.environ["VARIMESH_MPI"]
# Open MPI starts several processes on one core, and as root, only if it is told so.
PERMITTED = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
             "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_orte_abort_print_stack": "0",
             "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}  # Open MPI 5
SECONDS_TO_END = 10


def command(ranks, *arguments):
    return ["mpirun", "-n", str(ranks), VARIMESH_MPI, *map(str, arguments)]


def launch(ranks, *arguments, **keywords):
    return subprocess.run(command(ranks, *arguments), capture_output=True, text=True, timeout=100, env=PERMITTED, **keywords)


def ranks_of(process, count):
    """The processes that this mpirun has started. Waits until there are `count` of them."""
    deadline = time.monotonic() + 30
    while True:
        ranks = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True).stdout.split()
        if len(ranks) == count:
            return sorted(map(int, ranks))
        if time.monotonic() > deadline:
            raise TimeoutError(f"mpirun has started {len(ranks)} of {count} processes")
        time.sleep(0.05)


class WithMeshes(WithFolder):
    def binary(self, name):
        """A mesh of tests/cases as a binary file of MSH 4.1."""
        path = self.folder / name
        done = run("convert", CASES / name, path, "--format", "msh41-binary")
        self.assertEqual(done.returncode, 0, done.stderr)
        return path

    def grid(self, cubes, name="grid.msh"):
        """A cube of cubes³ hexahedra of order 2, which are skewed a little; its boundary has no elements."""
        path = self.folder / name
        side = 2 * cubes + 1
        node = lambda i, j, k: 1 + i + side * (j + side * k)
        with open(path, "wb") as file:
            file.write(b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Nodes\n")
            file.write(struct.pack("<4Q3iQ", 1, side**3, 1, side**3, 3, 1, 0, side**3))
            for first in range(1, side**3 + 1, side):
                file.write(struct.pack(f"<{side}Q", *range(first, first + side)))
            for k in range(side):
                for j in range(side):
                    file.write(b"".join(struct.pack("<3d", i + 0.1 * (j % 3), j + 0.1 * (k % 5), k) for i in range(side)))
            file.write(b"\n$EndNodes\n$Elements\n")
            file.write(struct.pack("<4Q3iQ", 1, cubes**3, 1, cubes**3, 3, 1, 12, cubes**3))
            # Gmsh's order of the nodes of a hexahedron of order 2.
            lattice = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2), (1, 0, 0),
                       (0, 1, 0), (0, 0, 1), (2, 1, 0), (2, 0, 1), (1, 2, 0), (2, 2, 1), (0, 2, 1), (1, 0, 2), (0, 1, 2),
                       (2, 1, 2), (1, 2, 2), (1, 1, 0), (1, 0, 1), (0, 1, 1), (2, 1, 1), (1, 2, 1), (1, 1, 2), (1, 1, 1)]
            number = 0
            for z in range(cubes):
                for y in range(cubes):
                    for x in range(cubes):
                        number += 1
                        nodes = [node(2 * x + i, 2 * y + j, 2 * z + k) for i, j, k in lattice]
                        file.write(struct.pack("<28Q", number, *nodes))
            file.write(b"\n$EndElements\n")
        return path


def main():
    """Runs the tests of the program's file, or skips them."""
    if shutil.which("mpirun") is None:
        print("SKIPPED: there is no mpirun (deploy/setup mpi)")
        sys.exit(77)
    unittest.main(verbosity=2)
