"""What the tests of the command share: paths from the environment, ways to run the command, and a server of their own.
ctest sets VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR. Only Python's standard library is needed."""
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

VARIMESH = os.environ["VARIMESH"]
VARIMESHD = os.environ["VARIMESHD"]
CASES = Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests" / "cases"
MESH = CASES / "nine_triangles.msh"
LARGER = CASES / "circle_p5.msh"
# Options of an optimisation that goes on until it is cancelled.
ENDLESS = ["--method", "sweeps", "--tolerance", "1e-15", "--max-iterations", "100000"]

# Two triangles of order 2. Node 5, the middle of the straight boundary edge from node 1 to node 2, lies beyond node 2.
FOLDED = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
9
1 0 0 0
2 1 0 0
3 0 1 0
4 1 1 0
5 1.3 0 0
6 0.5 0.5 0
7 0 0.5 0
8 1 0.5 0
9 0.5 1 0
$EndNodes
$Elements
2
1 9 2 1 1 1 2 3 5 6 7
2 9 2 1 1 2 4 3 8 9 6
$EndElements
"""


# Where each node of a triangle of order 4 comes from when it is turned: vertices 1 and 2 change places.
TURNED = [0, 2, 1, 11, 10, 9, 8, 7, 6, 5, 4, 3, 12, 14, 13]


def clockwise(mesh, elements):
    """The text of an MSH 2.2 file in which the triangles of order 4 with these numbers are turned."""
    lines = []
    for line in mesh.read_text().splitlines():
        words = line.split()
        if words[1:2] == ["23"] and int(words[0]) in elements:
            words = words[:-15] + [words[-15 + place] for place in TURNED]
        lines.append(" ".join(words))
    return "\n".join(lines) + "\n"


def run(*arguments, **keywords):
    """Runs the command to its end."""
    return subprocess.run([VARIMESH, *map(str, arguments)], capture_output=True, text=True, timeout=50, **keywords)


def run_bytes(*arguments, **keywords):
    """As run(), with arguments and outputs as bytes."""
    keywords = {"stdout": subprocess.PIPE, **keywords}
    return subprocess.run([VARIMESH, *arguments], stderr=subprocess.PIPE, timeout=50, **keywords)


def start(*arguments, **keywords):
    """Starts the command. Unless told otherwise, only its standard error can be read."""
    keywords = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, **keywords}
    return subprocess.Popen([VARIMESH, *map(str, arguments)], text=True, **keywords)


def wait_for_line(process, pattern):
    """Reads standard error up to a line that matches the pattern."""
    for line in process.stderr:
        if re.search(pattern, line):
            return line
    raise AssertionError(f"no line with {pattern}; the status is {process.wait(10)}")


class Server:
    """A varimeshd on a free loopback port. `environment`: variables that it gets besides those of this process."""

    def __init__(self, *flags, listen="127.0.0.1:0", **environment):
        self.folder = tempfile.TemporaryDirectory()
        port_file = Path(self.folder.name) / "address"
        self.process = subprocess.Popen(
            [VARIMESHD, "--listen", listen, "--port-file", str(port_file), "--data", self.folder.name, *flags],
            stderr=subprocess.PIPE, text=True, env={**os.environ, **environment})
        self.log = []
        self.reader = threading.Thread(target=lambda: self.log.extend(self.process.stderr))
        self.reader.start()
        deadline = time.monotonic() + 20
        while not port_file.exists():
            assert self.process.poll() is None and time.monotonic() < deadline, "".join(self.log)
            time.sleep(0.01)
        self.address = port_file.read_text().strip()

    def stop(self):
        """Ends the server. Returns its exit status and the folders that it left."""
        self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(40)
        self.reader.join()
        self.process.stderr.close()
        left = [path for path in Path(self.folder.name).iterdir() if path.is_dir()]
        self.folder.cleanup()
        return status, left


class WithFolder(unittest.TestCase):
    """A test with a temporary folder of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


class WithServer(WithFolder):
    """Tests with one server for all of them. The server must end in order and leave nothing behind."""

    @classmethod
    def setUpClass(cls):
        cls.server = Server("--log-level", "info")

    @classmethod
    def tearDownClass(cls):
        status, left = cls.server.stop()
        assert status == 0, f"varimeshd ended with {status}: {''.join(cls.server.log)}"
        assert not left, f"varimeshd left {left}"

    def remote(self, *arguments):
        """Runs the command with --server."""
        return run(*arguments, "--server", self.server.address)
