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
    support.main(Wheel={"python3-setuptools": "setuptools", "python3-wheel": "wheel"}, Types={"mypy": "mypy"})
