"""Puts the Python package, varimeshd and what both need into a wheel. deploy/make-wheel calls it:

    bundle_wheel.py PACKAGE VARIMESHD OUT [PROGRAM…]

PACKAGE is the built package, OUT the folder for the wheel, PROGRAM one more program that goes into it. The files come from Debian packages of this machine, and the
copyright file of each package goes into the wheel.
"""
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import google.protobuf
import grpc

# Every system with a glibc that is new enough has these (they are among those of PEP 600, and in a bare Debian).
SYSTEM = re.compile(r"(libc|libm|libdl|libpthread|librt|libresolv|libgcc_s|libstdc\+\+)\.so|ld-linux|linux-vdso")
VENDOR = Path("varimesh") / "vendor"
LIBRARIES = Path("varimesh") / "lib"
PROGRAMS = Path("varimesh") / "bin"


def output(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def needed(file):
    """The libraries that a program or library loads, directly or not: name and path."""
    for line in output("ldd", file).splitlines():
        found = re.match(r"\s*(\S+) => (/\S+)", line)
        if found and not SYSTEM.match(found[1]):
            yield found[1], Path(found[2])


def copy_modules(stage):
    """gRPC's and Protobuf's modules, the latter without their machine code: it would tie them to one Python for little."""
    leave_out = shutil.ignore_patterns("__pycache__", "*.so", "pyext", "compiler", "roots.pem")
    shutil.copytree(Path(google.protobuf.__file__).parent, stage / VENDOR / "google" / "protobuf", ignore=leave_out)
    modules = Path(grpc.__file__).parent
    shutil.copytree(modules, stage / VENDOR / "grpc", ignore=leave_out)
    (machine_code,) = modules.glob("_cython/cygrpc.*.so")
    copy = stage / VENDOR / "grpc" / "_cython" / machine_code.name
    shutil.copy(machine_code, copy)
    return copy


def set_library_path(file, path):
    """Makes a program or library look for libraries relative to its own place, before the system's."""
    subprocess.run(["patchelf", "--force-rpath", "--set-rpath", path, str(file)], check=True)


def copy_libraries(files, folder):
    """Copies the libraries that the files load into the folder, and returns where they came from."""
    libraries = dict(sorted({found for file in files for found in needed(file)}))
    folder.mkdir(parents=True, exist_ok=True)
    for name, path in libraries.items():
        shutil.copy(path.resolve(), folder / name)
        set_library_path(folder / name, "$ORIGIN")
    return [*libraries.values()]


def copy_licences(folder, files):
    """The copyright files of the Debian packages that own the files."""
    folder.mkdir()
    for file in files:
        # A library's package knows it under /usr/lib or /lib.
        paths = {str(file), str(file.resolve()), re.sub(r"^(/usr)?/lib/", "/usr/lib/", str(file.resolve()))}
        owner = next(name.split(":")[0] for path in paths
                     if (name := subprocess.run(["dpkg", "-S", path], capture_output=True, text=True).stdout))
        shutil.copy(Path("/usr/share/doc") / owner / "copyright", folder / owner)


def describe(stage, version):
    """Names the files in pyproject.toml, and requires what is not inside. `version` is the Python that gRPC's module fits."""
    project = stage / "pyproject.toml"
    text = project.read_text()
    only = f'; python_version != \\"{version}\\"'
    text = text.replace('"grpcio>=1.51", "protobuf>=3.21"', f'"grpcio>=1.51{only}", "protobuf>=3.21{only}"')
    text = text.replace('"*" = ["py.typed", "*.pyi"]',
                        '"*" = ["py.typed", "*.pyi", "bin/*", "lib/*", "licences/*", "vendor/**/*"]')
    assert only in text and "vendor/**/*" in text
    project.write_text(text)


def build_wheel(stage, out):
    """Builds the wheel and returns its path. Programs of this kind of machine are inside. The tag names no Python, because
    no other needs the module of one."""
    build = ("import sys; from setuptools import build_meta; "
             "print(build_meta.build_wheel(sys.argv[1], {'--build-option': ['--plat-name=linux_x86_64']}))")
    done = subprocess.run([sys.executable, "-c", build, str(out)], cwd=stage, check=True, stdout=subprocess.PIPE, text=True)
    return out / done.stdout.split()[-1]


def newest_glibc(files):
    versions = {tuple(map(int, found.split("."))) for file in files
                for found in re.findall(r"GLIBC_(\d+\.\d+)", output("objdump", "-p", file))}
    return ".".join(map(str, max(versions)))


def main(package, varimeshd, out, *more):
    stage = Path(tempfile.mkdtemp(prefix="varimesh-wheel-"))
    shutil.copytree(package, stage, dirs_exist_ok=True,
                    ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
    (stage / PROGRAMS).mkdir()
    programs = {stage / PROGRAMS / program.name: program for program in (varimeshd, *more)}
    for copy, program in programs.items():
        output("strip", "-o", copy, program)
    machine_code = copy_modules(stage)
    libraries = copy_libraries([*programs.values(), machine_code], stage / LIBRARIES)
    for copy in programs:
        set_library_path(copy, "$ORIGIN/../lib")
    set_library_path(machine_code, "$ORIGIN/../../../lib")
    copy_licences(stage / "varimesh" / "licences", [*libraries, Path(grpc.__file__), Path(google.protobuf.__file__)])
    describe(stage, f"{sys.version_info.major}.{sys.version_info.minor}")
    wheel = build_wheel(stage, out)
    inside = [*programs, machine_code, *(stage / LIBRARIES).iterdir()]
    print(f"{wheel}: {wheel.stat().st_size / 1e6:.0f} MB; needs glibc {newest_glibc(inside)} or newer, and numpy; "
          f"gRPC and Protobuf for Python {sys.version_info.major}.{sys.version_info.minor} are inside")
    shutil.rmtree(stage)


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
