"""Bodies with formulas, which Gmsh makes as CAD models and meshes."""
import functools
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

from geometry_test import gmsh_python
from programs import VARIMESH

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


python_with_gmsh = functools.cache(gmsh_python)


def need_gmsh():
    """Ends a test that cannot run here, and says so."""
    plugin = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
    if python_with_gmsh() is None or not plugin.exists() or not shutil.which("gmsh"):
        print("skipped: there is no program or Python module gmsh, or VariMesh was built without OpenCASCADE")
        sys.exit(77)


def make(body, path):
    """Writes the model of a body, whose name tells the format."""
    subprocess.run([python_with_gmsh(), "-c", MAKE.format(body=body), str(path)], check=True, capture_output=True)


def make_straight(model, mesh):
    """Writes a straight mesh of a model."""
    subprocess.run([python_with_gmsh(), "-c", STRAIGHT, str(model), str(mesh)], check=True, capture_output=True)


def certified(text):
    """How many elements there are, and how many are certified valid after the run."""
    elements = int(re.search(r"(\d+) elements", text).group(1))
    return elements, int(re.search(r"certified valid\s+\d+\s+(\d+)", text).group(1))
