"""varimeshd as a service of systemd: what it tells systemd, and its unit."""
import os
import re
import shutil
import signal
import socket
import subprocess
import unittest

from operators import environment, varimeshd
from programs import VARIMESHD, WithFolder, run

UNIT = os.environ["VARIMESH_SOURCE_DIR"] + "/deploy/varimeshd.service"


class Service(WithFolder):
    def test_systemd_is_told_how_the_server_is(self):
        path = self.folder / "notify"
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(str(path))
            manager.settimeout(30)
            process = subprocess.Popen([VARIMESHD, "--listen", f"unix:{self.folder}/socket", "--log-level", "off"],
                                       stdout=subprocess.DEVNULL, env=environment(NOTIFY_SOCKET=str(path)))
            try:
                said = manager.recv(1000).decode()
                while said == "WATCHDOG=1":
                    said = manager.recv(1000).decode()
                self.assertEqual(said, f"READY=1\nSTATUS=Listens on unix:{self.folder}/socket\n")
                self.assertEqual(run("info", "--server", f"unix:{self.folder}/socket").returncode, 0)
                self.assertEqual(manager.recv(1000).decode(), "WATCHDOG=1", "every five seconds")
                process.send_signal(signal.SIGTERM)
                while (said := manager.recv(1000).decode()) == "WATCHDOG=1":
                    continue
                self.assertEqual(said, "STOPPING=1")
            finally:
                process.terminate()
                self.assertEqual(process.wait(40), 0)

    def test_the_unit_is_right_and_hardened(self):
        if shutil.which("systemd-analyze") is None:
            self.skipTest("systemd-analyze is missing (Debian package systemd)")
        with open(UNIT) as file:
            text = file.read()
        self.assertIn("\nExecStart=/usr/bin/varimeshd\n", text)
        here = self.folder / "varimeshd.service"
        here.write_text(text.replace("ExecStart=/usr/bin/varimeshd\n", f"ExecStart={VARIMESHD}\n"))
        checked = subprocess.run(["systemd-analyze", "verify", here], capture_output=True, text=True, timeout=60)
        self.assertEqual((checked.returncode, checked.stderr), (0, ""))
        rated = subprocess.run(["systemd-analyze", "security", "--offline=true", here], capture_output=True, text=True,
                               timeout=60)
        level = re.search(r"Overall exposure level for varimeshd.service: ([\d.]+)", rated.stdout)
        self.assertLess(float(level[1]), 2.0)
        # What it sets must be settings.
        variables = dict(word.split("=", 1) for line in re.findall(r"^Environment=(.*)$", text, re.MULTILINE)
                         for word in line.split())
        self.assertIn("VARIMESHD_STATE", variables)
        done = varimeshd("--print-config", **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("# from the environment"), len(variables))


if __name__ == "__main__":
    unittest.main(verbosity=2)
