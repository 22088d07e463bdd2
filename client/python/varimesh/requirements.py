"""Finds what the package needs: numpy, gRPC, Protobuf and the generated modules before it is imported, and programs.

A wheel of deploy/make-wheel has gRPC and Protobuf in the folder `vendor`, for one version of Python. They are used only if
Python finds none of its own.
"""
from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

_HERE = Path(__file__).parent
_VENDOR = _HERE / "vendor"
_DISTRIBUTIONS = {"numpy": "numpy", "grpc": "grpcio", "google.protobuf": "protobuf"}


def _is_there(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:  # the package around it is missing
        return False


def _vendor_fits() -> bool:
    machine_code = _VENDOR / "grpc" / "_cython"
    return any((machine_code / f"cygrpc{suffix}").exists() for suffix in EXTENSION_SUFFIXES)


def check() -> None:
    """Makes the modules importable. Raises ImportError with a sentence that says what to install or to build."""
    if not (_HERE / "v1" / "service_pb2_grpc.py").exists():
        raise ImportError(
            f"The package varimesh in {_HERE} is not built: its generated modules are missing. Run 'cmake --preset release "
            "&& cmake --build --preset release --target varimesh_python' in the source tree, and put "
            "build/release/client/python/package on PYTHONPATH, or install the wheel of deploy/make-wheel.")  # fmt: skip
    missing = [module for module in _DISTRIBUTIONS if not _is_there(module)]
    if missing and missing != ["numpy"] and _vendor_fits():
        sys.path.append(str(_VENDOR))
        importlib.invalidate_caches()
        missing = [module for module in _DISTRIBUTIONS if not _is_there(module)]
    if missing:
        names = " ".join(_DISTRIBUTIONS[module] for module in missing)
        debian = " ".join("python3-" + _DISTRIBUTIONS[module] for module in missing)
        raise ImportError(f"varimesh needs modules that are not installed: run 'pip install {names}', or on Debian "
                          f"'apt-get install {debian}'.")  # fmt: skip


def find_program(name: str, variable: str) -> str | None:
    """The path of a program of VariMesh: what the environment variable says, or else the program in this package or in PATH.
    None if it is not there or cannot be run."""
    if said := os.environ.get(variable):
        return shutil.which(said)
    in_wheel = _HERE / "bin" / name  # where deploy/make-wheel puts it
    if in_wheel.exists() and not os.access(in_wheel, os.X_OK):  # not every installer keeps the permission
        with contextlib.suppress(OSError):
            in_wheel.chmod(0o755)
    return shutil.which(str(in_wheel)) or shutil.which(name)
