"""Shared by the tests of the package: a server, a proxy that breaks connections, and a loud skip if Debian's packages
are missing."""
import contextlib
import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

VARIMESH = os.environ["VARIMESH"]
VARIMESHD = os.environ["VARIMESHD"]
SOURCE = Path(os.environ["VARIMESH_SOURCE_DIR"])
CASES = SOURCE / "tests" / "cases"
MESH = CASES / "nine_triangles.msh"
LARGER = CASES / "circle_p5.msh"
ENDLESS = {"method": "sweeps", "tolerance": 1e-15, "max_iterations": 100_000}

_PACKAGES = {"grpc": "python3-grpcio", "google.protobuf": "python3-protobuf", "numpy": "python3-numpy"}


def skip(reason):
    """Ends a test that cannot run here, and says so."""
    print(f"SKIPPED: {reason}", flush=True)
    sys.exit(77)


def there(module):
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def need(**more):
    for module, package in {**_PACKAGES, **more}.items():
        if not there(module):
            skip(f"{package} is missing (deploy/setup test)")


def main(**needs):
    """Runs the tests of the group that the command line names, or all. `needs` maps a group to the modules or programs
    that it needs, by the package that has them."""
    if len(sys.argv) > 1:
        for package, module in needs.get(sys.argv[1], {}).items():
            if not (there(module) or shutil.which(module)):
                skip(f"{package} is missing (deploy/setup test)")
    unittest.main(verbosity=2)


class Server:
    """A varimeshd on a loopback port. It keeps the port when it is started again."""

    def __init__(self, *flags, folder=None):
        self.flags, self.address = flags, "127.0.0.1:0"
        self.folder = Path(folder or tempfile.mkdtemp())
        self.start()

    def start(self):
        port_file = self.folder / "address"
        port_file.unlink(missing_ok=True)
        self.process = subprocess.Popen([VARIMESHD, "--listen", self.address, "--port-file", str(port_file), "--log-level",
                                         "error", *self.flags])
        deadline = time.monotonic() + 20
        while not port_file.exists():
            assert self.process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        self.address = port_file.read_text().strip()

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        return self.process.wait(40)


class Cutter:
    """A proxy that cuts connections. `allowances` are the bytes that pass in one direction before each cut."""

    def __init__(self, address, allowances):
        host, port = address.rsplit(":", 1)
        self.target, self.allowances, self.cuts, self.passed = (host, int(port)), list(allowances), 0, 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                one, _ = self.listener.accept()
                other = socket.create_connection(self.target)
                for pair in ((one, other), (other, one)):
                    threading.Thread(target=self._pump, args=pair, daemon=True).start()

    def _pump(self, source, sink):
        here = 0
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                here += len(data)
                self.passed += len(data)
                if self.allowances and here > self.allowances[0]:
                    self.allowances.pop(0)
                    self.cuts += 1
                    break
                sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        source.close()

    def close(self):
        self.listener.close()


class WithFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


class WithServer(WithFolder):
    """A test with a server and a client."""

    @classmethod
    def setUpClass(cls):
        import varimesh

        cls.server = Server()
        cls.client = varimesh.Client(cls.server.address)

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        assert cls.server.stop() == 0

    @contextlib.contextmanager
    def running(self, **options):
        """A job that has begun, and that ends only when it is cancelled."""
        job = self.client.submit(LARGER, **ENDLESS, **options)
        try:
            next(event for event in job.watch() if event.iteration is not None)
            yield job
        finally:
            job.cancel()
            job.wait()
