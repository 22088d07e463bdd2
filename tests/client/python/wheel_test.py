"""The package as it is shipped: a wheel built without a network, and types that mypy accepts."""
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import support

support.need()
PACKAGE = Path(os.environ["VARIMESH_PACKAGE"])
PROXIES = {name: "http://127.0.0.1:1" for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY")}


class Wheel(support.WithFolder):
    def test_is_built_without_a_network_and_imported(self):
        source, out, site = (self.folder / name for name in ("source", "out", "site"))
        shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
        out.mkdir()
        build = "import sys; import build_backend; build_backend.build_wheel(sys.argv[1])"
        done = subprocess.run([sys.executable, "-c", build, str(out)], cwd=source, capture_output=True, text=True,
                              env={**os.environ, **PROXIES})
        self.assertEqual(done.returncode, 0, done.stderr[-2000:])
        (wheel,) = out.iterdir()
        self.assertRegex(wheel.name, r"^varimesh-\d+\.\d+\.\d+-py3-none-any\.whl$")
        with zipfile.ZipFile(wheel) as archive:
            names = archive.namelist()
            archive.extractall(site)
        for needed in ("varimesh/py.typed", "varimesh/v1/service_pb2_grpc.py", "varimesh/v1/job_pb2.pyi",
                       "varimesh/rpc/status_pb2.py"):
            self.assertIn(needed, names)
        program = ("import varimesh\nwith varimesh.local() as client: print(varimesh.__file__, client.info().version)")
        done = subprocess.run([sys.executable, "-c", program], cwd=self.folder, capture_output=True, text=True,
                              env={**os.environ, "PYTHONPATH": str(site)})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.split()[0], str(site / "varimesh" / "__init__.py"))

    def test_the_sources_say_what_to_run(self):
        """pip shows what the backend prints before it fails."""
        source = self.folder / "python"
        shutil.copytree(support.SOURCE / "client" / "python", source)
        ask = "import build_backend; build_backend.get_requires_for_build_wheel()"
        done = subprocess.run([sys.executable, "-c", ask], cwd=source, capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, "is not built: .* --target varimesh_python. Or run deploy/make-wheel")

    def test_can_be_imported_beside_google_s_error_details(self):
        """Python's protobuf refuses two files of the same name."""
        program = ("import sys\nfrom google.protobuf import descriptor_pb2, descriptor_pool as pool\n"
                   "for name in ('status', 'error_details'):\n"
                   "    pool.Default().Add(descriptor_pb2.FileDescriptorProto(\n"
                   "        name=f'google/rpc/{name}.proto', package='google.rpc',\n"
                   "        message_type=[descriptor_pb2.DescriptorProto(name={'status': 'Status'}.get(name, 'ErrorInfo'))]))\n"
                   "import varimesh")
        subprocess.run([sys.executable, "-c", program], check=True)


# Makes a sphere and a straight mesh of it.
SPHERE = """
import gmsh
gmsh.initialize(["", "-v", "1"])
gmsh.model.occ.addSphere(0, 0, 0, 1)
gmsh.model.occ.synchronize()
gmsh.write("sphere.step")
for option, value in ("MeshSizeMin", 0.6), ("MeshSizeMax", 0.6), ("SaveAll", 1):
    gmsh.option.setNumber("Mesh." + option, value)
gmsh.model.mesh.generate(3)
gmsh.write("straight.msh")
"""

# Curves the mesh, and says which package did so and how far the nodes of the boundary's elements are from the sphere.
CURVE = """
import gmsh
import numpy as np
import varimesh
with varimesh.local(processes=True) as client:
    result = client.optimise("straight.msh", "curved.msh", geometry=varimesh.Geometry("sphere.step", order=3))
gmsh.initialize(["", "-v", "1"])
gmsh.open("curved.msh")
radii = np.linalg.norm(gmsh.model.mesh.getNodes(2, includeBoundary=True)[1].reshape(-1, 3), axis=1)
print(varimesh.__file__, result.valid, len(radii), abs(radii - 1).max())
"""


class GeometryWheel(support.WithFolder):
    """Both wheels of deploy/make-wheel, in an environment of their own."""

    def bundle(self, script, *arguments):
        done = subprocess.run([sys.executable, support.SOURCE / "deploy" / script, *arguments], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr[-2000:])

    def in_environment(self, *command):
        """Runs a program without what the tests say of the build tree."""
        kept = {name: value for name, value in os.environ.items()
                if not name.startswith("VARIMESH") and name not in ("PYTHONPATH", "LD_LIBRARY_PATH")}
        return subprocess.run([str(word) for word in command], cwd=self.folder, capture_output=True, text=True,
                              env={**kept, **PROXIES})

    def test_curves_a_sphere_and_can_be_removed(self):
        command, out, venv = Path(support.VARIMESH), self.folder / "out", self.folder / "venv"
        programs = command.parent.parent / "lib" / "varimesh"
        out.mkdir()
        self.bundle("bundle_wheel.py", PACKAGE, support.VARIMESHD, out, command, programs / "varimesh_worker")
        self.bundle("bundle_geometry_wheel.py", PACKAGE, command.parent / "libvarimesh_opencascade.so",
                    command.parent / "varimesh_cad_reader", out)
        self.assertEqual(len(list(out.iterdir())), 2)
        subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", venv], check=True)
        pip, python = venv / "bin" / "pip", venv / "bin" / "python"
        (main,), (geometry,) = out.glob("varimesh-*.whl"), out.glob("varimesh_geometry-*.whl")
        done = self.in_environment(pip, "install", "--no-index", main)
        self.assertEqual(done.returncode, 0, done.stderr)
        (site,) = (venv / "lib").glob("python3*/site-packages")
        varimesh = site / "varimesh" / "bin" / "varimesh"
        before = {path for path in site.rglob("*")}
        self.assertIn("missing", self.in_environment(varimesh, "doctor").stdout.split("CAD plugin")[1].splitlines()[0])
        done = self.in_environment(pip, "install", "--no-index", geometry)
        self.assertEqual(done.returncode, 0, done.stderr)
        said = self.in_environment(varimesh, "doctor").stdout
        self.assertIn(f"ok  CAD plugin       {site}/varimesh/lib/varimesh/", said)
        loaded = self.in_environment("ldd", site / "varimesh" / "lib" / "varimesh" / "varimesh_cad_reader").stdout
        self.assertRegex(loaded, f"libTKernel.so.* => {site}")  # not those of the system

        made = self.in_environment(sys.executable, "-c", SPHERE)
        self.assertEqual(made.returncode, 0, made.stderr)
        done = self.in_environment(python, "-c", CURVE)
        self.assertEqual(done.returncode, 0, done.stderr)
        where, valid, nodes, distance = done.stdout.split()
        self.assertEqual((where, valid), (str(site / "varimesh" / "__init__.py"), "True"))
        self.assertGreater(int(nodes), 100)
        self.assertLess(float(distance), 1e-12)
        done = self.in_environment(varimesh, "curve", "straight.msh", "--geometry", "sphere.step", "--order", "3", "-o",
                                   "command.msh", "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "command.msh").read_bytes(), (self.folder / "curved.msh").read_bytes())

        self.in_environment(pip, "uninstall", "--yes", "varimesh-geometry")
        self.assertEqual({path for path in site.rglob("*")} ^ before, set())


class Types(support.WithFolder):
    def test_mypy_accepts_the_package_and_finds_a_wrong_option(self):
        """In the method and in the function without a client, which have the same types."""
        program = self.folder / "program.py"
        program.write_text("import varimesh\n"
                           "def f(client: varimesh.Client) -> float:\n"
                           "    varimesh.optimise('in.msh', ['out.msh', 'r.html'], energy='winslow', progress=True).history\n"
                           "    varimesh.quality('in.msh', lattice=3).scaled_jacobian\n"
                           "    return client.optimise('in.msh', energy='winslow').after.min_scaled_jacobian\n"
                           "varimesh.Client('x').optimise('in.msh', energy='none')\n"
                           "varimesh.optimise('in.msh', energy='none')\n"
                           "varimesh.optimise('in.msh', enrgy='winslow')\n"
                           "varimesh.quality('in.msh', lattice='3')\n")
        done = subprocess.run(["mypy", "--config-file", str(PACKAGE / "pyproject.toml"), "--cache-dir",
                               str(self.folder / "cache"), "-p", "varimesh"], cwd=PACKAGE, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)
        done = subprocess.run(["mypy", "--config-file", str(PACKAGE / "pyproject.toml"), "--cache-dir",
                               str(self.folder / "cache"), str(program)], cwd=PACKAGE, capture_output=True, text=True,
                              env={**os.environ, "MYPYPATH": str(PACKAGE)})
        self.assertEqual(done.stdout.count("error:"), 4, done.stdout)
        for line, what in ((6, 'Argument "energy"'), (7, 'Argument "energy"'), (8, 'Unexpected keyword argument "enrgy"'),
                           (9, 'Argument "lattice"')):
            self.assertIn(f"program.py:{line}: error: {what}", done.stdout)

    def test_the_functions_without_a_client_have_the_signatures_of_the_methods(self):
        import inspect

        import varimesh

        for function, method in ((varimesh.optimise, varimesh.Client.optimise), (varimesh.quality, varimesh.Client.quality)):
            ours, theirs = inspect.signature(function), inspect.signature(method)
            self.assertEqual(list(ours.parameters.values()), list(theirs.parameters.values())[1:])
            self.assertEqual(ours.return_annotation, theirs.return_annotation)


if __name__ == "__main__":
    build = {"python3-setuptools": "setuptools", "python3-wheel": "wheel"}
    if sys.argv[1:] == ["GeometryWheel"] and not (Path(support.VARIMESH).parent / "libvarimesh_opencascade.so").exists():
        support.skip("VariMesh was built without OpenCASCADE")
    support.main(Wheel=build, Types={"mypy": "mypy"},
                 GeometryWheel={**build, "patchelf": "patchelf", "binutils": "strip", "python3-venv": "ensurepip",
                                "python3-gmsh": "gmsh"})
