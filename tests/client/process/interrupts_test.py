"""Ctrl-C: once, twice, and while a server hangs."""
import os
import re
import signal
import time
import unittest
from pathlib import Path

from programs import ENDLESS, LARGER, MESH, Server, WithFolder, start, wait_for_line


class Interrupts(WithFolder):
    def test_a_second_ctrl_c_leaves_nothing_behind(self):
        # Nothing reads from the pipe, so the command waits, and the meshes of the service stay on the disk.
        pipe, temporary = self.folder / "pipe.msh", self.folder / "tmp"
        os.mkfifo(pipe)
        temporary.mkdir()
        client = start("optimise", MESH, "-o", pipe, env={**os.environ, "TMPDIR": str(temporary)})
        wait_for_line(client, "succeeded")
        self.assertNotEqual(list(temporary.iterdir()), [])
        for _ in range(2):
            client.send_signal(signal.SIGINT)
            while client.poll() is None and not re.search(r"(?m)^ShdPnd:\s*0+$",
                                                          Path(f"/proc/{client.pid}/status").read_text()):
                time.sleep(0.01)
        _, stderr = client.communicate(timeout=20)
        self.assertEqual(client.returncode, 130, stderr)
        self.assertEqual(list(temporary.iterdir()), [])

    def test_one_ctrl_c_ends_a_command_that_waits_for_a_server_that_hangs(self):
        server = Server()
        try:
            client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
            wait_for_line(client, "residual")
            server.process.send_signal(signal.SIGSTOP)
            client.send_signal(signal.SIGINT)
            _, stderr = client.communicate(timeout=20)
            self.assertEqual(client.returncode, 130, stderr)
            self.assertIn("may still be running", stderr)
            asking = start("jobs", "--server", server.address)
            status = Path(f"/proc/{asking.pid}/status")
            while not int(re.search(r"(?m)^SigBlk:\s*(\w+)$", status.read_text())[1], 16) & 1 << signal.SIGINT - 1:
                time.sleep(0.01)  # Before the signal is blocked, the command would end without a message.
            asking.send_signal(signal.SIGINT)
            self.assertIn("nterrupted", asking.communicate(timeout=10)[1])
            self.assertEqual(asking.returncode, 130)
        finally:
            server.process.send_signal(signal.SIGCONT)
            server.stop()


if __name__ == "__main__":
    unittest.main(verbosity=2)
