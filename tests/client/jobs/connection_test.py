"""Commands while the server goes away and comes back."""
import re
import socket
import subprocess
import time
import unittest

from programs import ENDLESS, LARGER, VARIMESHD, Server, WithFolder, run, start, wait_for_line


class Connection(WithFolder):
    def test_where_nobody_listens_that_is_said_within_a_second(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:  # and closed, so that nobody listens there
            port = taken.getsockname()[1]
        for address, named in ((f"127.0.0.1:{port}", f"127.0.0.1:{port}"), (f"https://127.0.0.1:{port}", f"127.0.0.1:{port}"),
                               (f"unix:{self.folder}/none", f"unix:{self.folder}/none")):
            took = []
            for _ in range(3):  # other tests may hold the processors for once
                begin = time.monotonic()
                done = run("jobs", "--server", address)
                took.append(time.monotonic() - begin)
                self.assertEqual(done.returncode, 5)
                self.assertIn(f"There is no server at {named}; start varimeshd there", done.stderr)
            self.assertLess(min(took), 1)
            self.assertLess(max(took), 4)

    def test_where_nobody_answers_that_is_said_soon(self):
        """As where packets are dropped: the connection is there, and nothing comes."""
        with socket.create_server(("127.0.0.1", 0)) as silent:
            address = "127.0.0.1:%d" % silent.getsockname()[1]
            client = start("jobs", "--server", address)
            begin = time.monotonic()
            line = client.stderr.readline()
            self.assertLess(time.monotonic() - begin, 4)
            self.assertEqual(line, f"varimesh: nothing answers at {address} yet; waiting for up to 5 s\n")
            _, stderr = client.communicate(timeout=30)
            self.assertEqual(client.returncode, 5)
            self.assertIn(f"There is no server at {address}", stderr)
            self.assertNotIn("yet", run("info", "--server", address).stderr.replace(line, "", 1))

    def test_a_server_that_is_just_being_started_is_found(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            address = "127.0.0.1:%d" % taken.getsockname()[1]
        client = start("jobs", "--server", address)
        time.sleep(0.3)
        server = Server(listen=address)
        try:
            _, stderr = client.communicate(timeout=30)
            self.assertEqual(client.returncode, 0, stderr)
        finally:
            server.stop()

    def test_says_when_the_server_goes_and_when_it_is_back(self):
        server = Server()
        client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
        wait_for_line(client, "residual")
        server.process.kill()
        wait_for_line(client, "the server is not answering; trying again")
        server.stop()
        back = subprocess.Popen([VARIMESHD, "--listen", server.address, "--log-level", "off"], stdout=subprocess.DEVNULL)
        try:
            _, stderr = client.communicate(timeout=30)
        finally:
            back.terminate()
            back.wait(20)
        # The servers keep their jobs in memory, so the new one does not know the job.
        self.assertEqual(re.findall("not answering|answers again", stderr), ["answers again"], stderr)
        self.assertEqual(client.returncode, 2, stderr)

    def test_goes_on_after_a_restart_of_the_server(self):
        work = [LARGER, "--method", "sweeps", "--active-set", "off", "--tolerance", "1e-15", "--max-iterations", "1000"]
        alone, out, fetched = (self.folder / name for name in ("alone.msh", "out.msh", "fetched.msh"))
        self.assertEqual(run("optimise", *work, "-o", alone, "--quiet").returncode, 0)
        flags = ["--state", self.folder / "state", "--checkpoint-seconds", "0.1"]
        server = Server(*flags)
        optimising = start("optimise", *work, "-o", out, "--server", server.address)
        wait_for_line(optimising, "residual")
        job = run("jobs", "--server", server.address).stdout.splitlines()[1].split()[0]  # below the header
        watching = start("watch", job, "--server", server.address)
        wait_for_line(watching, "residual")
        time.sleep(0.5)
        server.process.kill()
        for client in (optimising, watching):
            wait_for_line(client, "the server is not answering; trying again")
        server.stop()
        back = Server(*flags, listen=server.address)
        try:
            for client in (optimising, watching):
                _, stderr = client.communicate(timeout=60)
                self.assertEqual(client.returncode, 0, stderr)
                self.assertEqual(re.findall("not answering|answers again", stderr), ["answers again"], stderr)
            self.assertEqual(run("result", job, "-o", fetched, "--server", back.address).returncode, 0)
            self.assertEqual(out.read_bytes(), alone.read_bytes())
            self.assertEqual(fetched.read_bytes(), alone.read_bytes())
        finally:
            back.stop()


if __name__ == "__main__":
    unittest.main(verbosity=2)
