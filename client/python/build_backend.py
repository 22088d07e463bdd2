"""What pip calls to build the package: setuptools, in the folder that has the generated modules.

`pip install client/python` finds them in build/release/client/python/package after the target varimesh_python was built.
Without it, the error says what to run.
"""
import filecmp
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
REQUIRED = ["setuptools>=66", "wheel"]
BUILD = "cmake --preset release && cmake --build --preset release --target varimesh_python"


def complete(folder):
    return (folder / "varimesh" / "v1" / "service_pb2_grpc.py").exists()


def built_package():
    """The folder of the package with its generated modules. Exits with a sentence if there is none."""
    if complete(HERE):
        return HERE
    package = HERE.parents[1] / "build" / "release" / "client" / "python" / "package"
    if not complete(package):
        sys.exit(f"The package varimesh is not built: {HERE} has only the sources. Run this in {HERE.parents[1]}, then try "
                 f"again: {BUILD}. Or run deploy/make-wheel, and install the wheel in build/wheel.")
    for source in (HERE / "varimesh").glob("*.py"):
        copy = package / "varimesh" / source.name
        if not copy.exists() or not filecmp.cmp(source, copy, shallow=False):
            sys.exit(f"The package in {package} is older than {source}. Run this in {HERE.parents[1]}, then try again: {BUILD}")
    return package


def get_requires_for_build_wheel(config_settings=None):
    built_package()
    return REQUIRED


def get_requires_for_build_sdist(config_settings=None):
    built_package()
    return REQUIRED


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    out = os.path.abspath(wheel_directory)
    os.chdir(built_package())
    from setuptools import build_meta

    return build_meta.build_wheel(out, config_settings)


def build_sdist(sdist_directory, config_settings=None):
    out = os.path.abspath(sdist_directory)
    os.chdir(built_package())
    from setuptools import build_meta

    return build_meta.build_sdist(out, config_settings)
