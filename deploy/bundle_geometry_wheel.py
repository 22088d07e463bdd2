"""Puts the plugin that reads CAD files, its program and OpenCASCADE into a wheel. deploy/make-wheel calls it:

    bundle_geometry_wheel.py PACKAGE PLUGIN READER OUT

PACKAGE is the built Python package, whose version the wheel has and requires; OUT is the folder for the wheel. Everything
goes into varimesh/lib/varimesh, where the programs of the other wheel look for it. No file of the other wheel is there, so
each can be removed without the other.
"""
import re
import shutil
import sys
import tempfile
from pathlib import Path

from bundle_wheel import build_wheel, copy_libraries, copy_licences, newest_glibc, output, set_library_path

FOLDER = Path("varimesh") / "lib" / "varimesh"
PROJECT = """
[build-system]
requires = ["setuptools>=66", "wheel"]
build-backend = "setuptools.build_meta"

[project]
name = "varimesh-geometry"
version = "{version}"
description = "Reads CAD models (STEP, IGES, BREP) for varimesh"
requires-python = ">=3.11"
license = {{text = "Apache-2.0; OpenCASCADE: LGPL-2.1 with an exception"}}
dependencies = ["varimesh=={version}"]

[tool.setuptools]
packages = ["varimesh.lib.varimesh", "varimesh.lib.varimesh.licences"]

[tool.setuptools.package-data]
"*" = ["*"]
"""


def main(package, plugin, reader, out):
    version = re.search(r'"(.+)"', (package / "varimesh" / "version.py").read_text())[1]
    stage = Path(tempfile.mkdtemp(prefix="varimesh-geometry-wheel-"))
    folder = stage / FOLDER
    libraries = copy_libraries([plugin, reader], folder)
    for program in (plugin, reader):
        output("strip", "-o", folder / program.name, program)
        set_library_path(folder / program.name, "$ORIGIN")
    inside = [*folder.iterdir()]
    copy_licences(folder / "licences", libraries)
    (stage / "pyproject.toml").write_text(PROJECT.format(version=version))
    wheel = build_wheel(stage, out)
    print(f"{wheel}: {wheel.stat().st_size / 1e6:.0f} MB; needs glibc {newest_glibc(inside)} or newer, and varimesh {version}")
    shutil.rmtree(stage)


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
