"""What a server needs to start if others than its owner may call it, and what it does by default."""
import os
import signal
import stat
import subprocess
import tempfile
import unittest
from pathlib import Path

from certificates_test import as_server, environment, make
from programs import VARIMESHD, Server, WithFolder, run, start


class Starting(WithFolder):
    """What a server may listen on."""

    def setUp(self):
        super().setUp()
        self.certificates = self.folder / "certificates"
        make(self.certificates)
        (self.folder / "tokens").write_text("")

    def refuse(self, *flags):
        done = subprocess.run([VARIMESHD, *flags], capture_output=True, text=True, timeout=20, env=environment())
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_beyond_loopback_it_needs_tls_and_callers_that_it_knows(self):
        beyond, tokens = ["--listen", "0.0.0.0:0"], ["--tokens", str(self.folder / "tokens")]
        for flags in ([], tokens, as_server(self.certificates, mutual=False)):
            self.assertIn("--insecure", self.refuse(*beyond, *flags))
        for flags in (as_server(self.certificates), [*as_server(self.certificates, mutual=False), *tokens]):
            server = Server("--log-level", "off", *flags, listen="0.0.0.0:0")
            self.assertEqual(server.stop()[0], 0)
            self.assertEqual("".join(server.log), "")
        for flags, words in (([], "use this server, and read"), (tokens, "their tokens too"),
                             (as_server(self.certificates, mutual=False), "can use this server")):
            server = Server("--log-level", "off", "--insecure", *flags, listen="0.0.0.0:0")
            server.stop()
            self.assertIn("WARNING", "".join(server.log))
            self.assertIn(words, "".join(server.log))

    def test_files_that_do_not_fit_are_refused(self):
        make(self.folder / "expired", "--days", "0")
        other = self.folder / "other"
        make(other)
        listen = ["--listen", "127.0.0.1:0"]
        good = as_server(self.certificates)
        self.assertIn("expired", self.refuse(*listen, *as_server(self.folder / "expired")))
        self.assertIn("--tls-key", self.refuse(*listen, *good[:2]))
        self.assertIn("--tls-certificate", self.refuse(*listen, *good[2:4]))
        self.assertIn("values mismatch", self.refuse(*listen, *good[:2], "--tls-key", str(other / "server-key.pem")))
        self.assertIn("--tls-authority", self.refuse(*listen, *good[:4], "--tls-authority", str(self.folder / "none")))
        for name, modes in (("server-key.pem", (0o644, 0o620, 0o602, 0o604)), ("authority.pem", (0o664, 0o646))):
            for mode in modes:
                (other / name).chmod(mode)
                said = self.refuse(*listen, *as_server(other))
                self.assertIn("chmod", said, (name, oct(mode)))
                self.assertIn(name, said)
            (other / name).chmod(0o600)
        self.assertIn("unix socket", self.refuse("--listen", f"unix:{self.folder}/socket", *good))

    @unittest.skipIf(os.geteuid() != 0, "only root can give files to others")
    def test_keys_of_others_are_refused(self):
        for name in ("server-key.pem", "authority.pem"):
            os.chown(self.certificates / name, 65534, 65534)
            said = self.refuse("--listen", "127.0.0.1:0", *as_server(self.certificates))
            self.assertIn("belongs to another user", said)
            self.assertIn(name, said)
            os.chown(self.certificates / name, 0, 0)

    def test_by_default_only_its_owner_can_use_it(self):
        state = self.folder / "state"
        with tempfile.TemporaryDirectory() as runtime:
            os.chmod(runtime, 0o700)
            for flags, path in ((["--state", str(state)], state / "socket"), ([], Path(runtime) / "varimeshd.socket")):
                server = subprocess.Popen([VARIMESHD, *flags], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                          env=environment(XDG_RUNTIME_DIR=runtime))
                try:
                    self.assertEqual(server.stdout.readline().strip(), f"varimeshd listens on unix:{path}")
                    self.assertEqual(stat.S_IMODE(path.stat().st_mode), 0o600)
                    self.assertEqual(stat.S_IMODE(path.parent.stat().st_mode), 0o700)
                    done = run("jobs", "--server", f"unix:{path}", env=environment(VARIMESH_TLS_AUTHORITY="nowhere"))
                    self.assertEqual(done.returncode, 0, done.stderr)
                    self.without_an_address(path, state if flags else "", runtime)
                finally:
                    server.send_signal(signal.SIGTERM)
                    server.communicate(timeout=40)

    def without_an_address(self, path, state, runtime):
        """Commands without --server find a server of their user, but not in a folder that others can write into."""
        own = environment(XDG_RUNTIME_DIR=runtime, VARIMESH_STATE=str(state))
        done = run("jobs", env=own)
        self.assertEqual((done.returncode, done.stdout), (0, ""), done.stderr)
        self.assertIn("There are no such jobs", done.stderr)
        path.parent.chmod(0o770)
        done = run("jobs", env=own)
        path.parent.chmod(0o700)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn(f"no varimeshd of yours listens on {path}; start one, or name a server with --server", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
