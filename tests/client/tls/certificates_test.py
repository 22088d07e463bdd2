"""Certificates to try a server with TLS. Other tests take the functions that make them and name them in flags."""
import contextlib
import os
import ssl
import stat
import unittest
from pathlib import Path

from programs import WithFolder, run

VARIABLES = ("TOKEN", "TOKEN_FILE", "TLS_AUTHORITY", "TLS_CERTIFICATE", "TLS_KEY")


def make(folder, *arguments):
    done = run("certificates", folder, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def as_client(folder, name=None):
    """The flags of a client with the certificates of a folder; without a name, it has none of its own."""
    flags = ["--tls-authority", folder / "authority.pem"]
    return flags + (["--tls-certificate", folder / f"{name}.pem", "--tls-key", folder / f"{name}-key.pem"] if name else [])


def as_server(folder, mutual=True):
    flags = ["--tls-certificate", str(folder / "server.pem"), "--tls-key", str(folder / "server-key.pem")]
    return flags + (["--tls-authority", str(folder / "authority.pem")] if mutual else [])


def environment(**variables):
    kept = {key: value for key, value in os.environ.items() if key not in ["VARIMESH_" + name for name in VARIABLES]}
    return {**kept, **variables}


class MakingCertificates(WithFolder):
    def test_only_the_owner_can_read_the_keys(self):
        made = make(self.folder / "new", "--client", "ann", "--client", "bob")
        names = {Path(path).name for path in made}
        self.assertEqual(names, {f"{name}{key}.pem" for name in ("authority", "server", "ann", "bob") for key in ("", "-key")})
        for path in made:
            self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600 if path.endswith("-key.pem") else 0o644, path)

    def test_the_authority_of_the_folder_is_used_again(self):
        make(self.folder)
        before = {name: (self.folder / name).read_text() for name in ("authority.pem", "server.pem")}
        make(self.folder)
        self.assertEqual((self.folder / "authority.pem").read_text(), before["authority.pem"])
        self.assertNotEqual((self.folder / "server.pem").read_text(), before["server.pem"])
        (self.folder / "authority.pem").write_text("nothing")
        self.assertEqual(run("certificates", self.folder).returncode, 3)

    def test_another_client_leaves_the_certificates_of_the_others(self):
        make(self.folder, "--host", "mesh.example.org", "--client", "ann")
        before = {path.name: path.read_bytes() for path in self.folder.iterdir()}
        made = {Path(path).name for path in make(self.folder, "--client", "bob")}
        self.assertEqual(made, {"bob.pem", "bob-key.pem"})
        self.assertEqual({name: (self.folder / name).read_bytes() for name in before}, before)
        made = {Path(path).name for path in make(self.folder, "--host", "other.example.org", "--client", "bob")}
        self.assertEqual(made, {"server.pem", "server-key.pem", "bob.pem", "bob-key.pem"})

    def test_those_who_check_strictly_accept_them(self):
        """As Python 3.13 does unless it is told otherwise."""
        make(self.folder, "--client", "ann")
        inside, outside, parties = ssl.MemoryBIO(), ssl.MemoryBIO(), []
        for name, purpose in (("server", ssl.Purpose.CLIENT_AUTH), ("ann", ssl.Purpose.SERVER_AUTH)):
            context = ssl.create_default_context(purpose, cafile=self.folder / "authority.pem")
            context.load_cert_chain(self.folder / f"{name}.pem", self.folder / f"{name}-key.pem")
            context.verify_mode = ssl.CERT_REQUIRED
            context.verify_flags |= ssl.VERIFY_X509_STRICT
            is_server = name == "server"
            streams = (inside, outside) if is_server else (outside, inside)
            parties.append(context.wrap_bio(*streams, server_side=is_server, server_hostname=None if is_server else "localhost"))
        for _ in range(4):
            for party in parties:
                with contextlib.suppress(ssl.SSLWantReadError):
                    party.do_handshake()
        names = [dict(fields for (fields,) in party.getpeercert()["subject"])["commonName"] for party in parties]
        self.assertEqual(names, ["ann", "VariMesh server"])

    def test_names_that_cannot_be_are_refused(self):
        for flags in (["--client", "../ann"], ["--client", "server"], ["--client", "a-key"], ["--host", "a/b"], ["--host", ""],
                      ["--host", "a,DNS:b"], ["--days", "-1"]):
            self.assertEqual(run("certificates", self.folder, *flags).returncode, 2, flags)
        self.assertEqual(list(self.folder.iterdir()), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
