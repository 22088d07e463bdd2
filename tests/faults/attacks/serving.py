"""The server that is attacked, as an operator starts it for owners with tokens, and the owner who works beside the attacker."""
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bystander import Owner
from programs import MESH, VARIMESHD, Server, run

HERE = Path(__file__).parent
ROOM = 64  # MiB that the server may have more than before the attack


def quantile(values, part):
    """0 if there are no values."""
    return sorted(values)[int(part * (len(values) - 1))] if values else 0.0


def until(holds, seconds=30, why="it did not happen in time"):
    deadline = time.monotonic() + seconds
    while not (value := holds()):
        assert time.monotonic() < deadline, why() if callable(why) else why
        time.sleep(0.02)
    return value


class Attacked:
    """A server with the owners 'mallory', who attacks, and 'ann', who works. `tls`: the server asks for certificates, and has no
    tokens. `state`: its state directory; by default one in its folder."""

    def __init__(self, *flags, tls=False, state=None):
        self.temporary = tempfile.TemporaryDirectory(prefix="varimesh-attacks-")
        self.folder = Path(self.temporary.name)
        self.state = Path(state or self.folder / "state")
        self.files, self.tokens = {}, {"ann": "", "mallory": ""}
        if tls:
            done = run("certificates", self.folder, "--client", "ann", "--client", "mallory")
            assert done.returncode == 0, done.stderr
            own = ["--tls-certificate", "server.pem", "--tls-key", "server-key.pem", "--tls-authority", "authority.pem"]
            flags = (*flags, *(str(self.folder / word) if word.endswith(".pem") else word for word in own))
        else:
            for owner in self.tokens:
                self.tokens[owner] = subprocess.run([VARIMESHD, "token", owner, "--tokens", self.folder / "tokens"],
                                                    capture_output=True, text=True, check=True, timeout=20).stdout.strip()
            flags = (*flags, "--tokens", str(self.folder / "tokens"))
        self.tls = tls
        self.flags = ("--state", str(self.state), "--threads", "2", "--max-running-jobs-per-peer", "1", *flags)
        self.server = Server(*self.flags)
        self.address = self.server.address

    def settings(self, owner):
        """What the calls of this owner need."""
        files = {"authority": "authority.pem", "certificate": f"{owner}.pem", "key": f"{owner}-key.pem"} if self.tls else {}
        return {"address": self.address, "token": self.tokens[owner],
                **{name: str(self.folder / file) for name, file in files.items()}}

    def owner(self, name):
        return Owner(**self.settings(name))

    def works(self):
        """The process of the owner who works."""
        process = subprocess.Popen([sys.executable, HERE / "bystander.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        process.stdin.write(json.dumps({**self.settings("ann"), "mesh": str(MESH), "http": self.http()}) + "\n")
        process.stdin.flush()
        return process

    def http(self):
        """HOST:PORT of --http; none if the server was started without it."""
        if "--http" not in self.flags:
            return None
        return until(lambda: (found := re.findall(r"http://(127\.0\.0\.1:\d+)/v1/", self.log())) and found[0])

    def memory(self):
        """MiB that the server and the processes of its jobs have."""
        total = 0
        for folder in Path("/proc").iterdir():
            try:
                status = (folder / "status").read_text()
            except (OSError, ValueError):
                continue
            parent, size = re.search(r"^PPid:\s+(\d+)", status, re.M), re.search(r"^VmRSS:\s+(\d+)", status, re.M)
            if size and str(self.server.process.pid) in (folder.name, parent[1]):
                total += int(size[1]) / 1024
        return total

    def log(self):
        return "".join(self.server.log)

    def alive(self):
        return self.server.process.poll() is None

    def stop(self):
        self.server.stop()
        self.temporary.cleanup()
