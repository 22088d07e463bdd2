"""A server that asks who calls: the command and the Python client with right and wrong tokens, and what the log shows.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import hashlib
import importlib.util
import json
import os
import subprocess
import time
import unittest

from programs import ENDLESS, LARGER, MESH, VARIMESHD, Server, WithFolder, run, start

EVERYTHING = ("submit", "read", "cancel")


def make_token(file, name, *roles, **more):
    """What 'varimeshd token' prints."""
    flags = [word for role in roles for word in ("--role", role)]
    flags += [word for key, value in more.items() for word in ("--" + key, value)]
    done = subprocess.run([VARIMESHD, "token", name, "--tokens", file, *flags], capture_output=True, text=True, timeout=20)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def environment(**variables):
    kept = {key: value for key, value in os.environ.items() if not key.startswith("VARIMESH_TOKEN")}
    return {**kept, **variables}


class MakingTokens(WithFolder):
    def test_the_file_has_the_digest_and_not_the_token(self):
        file = self.folder / "tokens"
        tokens = [make_token(file, "ann", until="2030-01-31"), make_token(file, "bob", "admin")]
        self.assertEqual(file.stat().st_mode & 0o777, 0o600)
        lines = file.read_text().splitlines()
        digests = [hashlib.sha256(token.encode()).hexdigest() for token in tokens]
        self.assertEqual(lines, [f"ann submit,read,cancel {digests[0]} 2030-01-31", f"bob admin {digests[1]}"])

    def test_a_line_without_an_end_stays_a_line(self):
        file = self.folder / "tokens"
        file.write_text("# by hand")
        make_token(file, "ann", "read")
        self.assertEqual(len(file.read_text().splitlines()), 2)

    def test_the_file_has_a_default_in_the_environment(self):
        file = self.folder / "tokens"
        done = subprocess.run([VARIMESHD, "token", "ann"], capture_output=True, text=True, timeout=20,
                              env=environment(VARIMESH_TOKENS=str(file)))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(file.read_text().startswith("ann submit,read,cancel "))
        done = subprocess.run([VARIMESHD, "token", "ann"], capture_output=True, text=True, timeout=20, env=environment())
        self.assertEqual(done.returncode, 2)
        self.assertIn("--tokens", done.stderr)

    def test_a_token_that_has_expired_is_not_made(self):
        for until in ("2020-01-31", "2026-01-01T00:00:00Z", time.strftime("%Y-%m-%d", time.gmtime())):
            done = subprocess.run([VARIMESHD, "token", "ann", "--until", until, "--tokens", self.folder / "tokens"],
                                  capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2, until)
            self.assertIn("expired", done.stderr)
        self.assertFalse((self.folder / "tokens").exists())

    def test_what_cannot_be_in_the_file_is_refused(self):
        for arguments in (["a b"], ["ann", "--role", "write"], ["ann", "--until", "soon"], []):
            done = subprocess.run([VARIMESHD, "token", *arguments, "--tokens", self.folder / "tokens"],
                                  capture_output=True, text=True, timeout=20)
            self.assertNotEqual(done.returncode, 0, arguments)
        self.assertFalse((self.folder / "tokens").exists())

    def test_a_server_does_not_start_with_a_wrong_file(self):
        file = self.folder / "tokens"
        for text in (None, "a-secret-in-the-wrong-place\n"):
            if text:
                file.write_text(text)
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--tokens", file], capture_output=True, text=True,
                                  timeout=20)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("of tokens", done.stderr)
            self.assertNotIn("secret", done.stderr)


class CallingBase(WithFolder):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "tokens"
        self.ann, self.bob = make_token(self.file, "ann", *EVERYTHING), make_token(self.file, "bob", *EVERYTHING)
        self.reader = make_token(self.file, "ann", "read")
        self.server = Server("--tokens", str(self.file), "--log-level", "trace", "--threads", "1")
        self.stopped = False
        self.addCleanup(lambda: self.stopped or self.server.stop())

    def call(self, token, *arguments):
        return run(*arguments, "--server", self.server.address, env=environment(VARIMESH_TOKEN=token))


class Calling(CallingBase):
    def test_the_command_takes_tokens_from_options_and_the_environment(self):
        (self.folder / "token").write_text(self.ann + "\n")
        wrong = environment(VARIMESH_TOKEN="wrong", VARIMESH_TOKEN_FILE="nowhere")
        for arguments, env in (([], environment(VARIMESH_TOKEN=self.ann)),
                               ([], environment(VARIMESH_TOKEN_FILE=str(self.folder / "token"))),
                               (["--token-file", self.folder / "token"], wrong)):
            done = run("optimise", MESH, "-o", self.folder / "out.msh", "--server", self.server.address, *arguments, env=env)
            self.assertEqual(done.returncode, 0, done.stderr)
            done = run("doctor", "--server", self.server.address, *arguments, env=env)
            self.assertEqual(done.returncode, 0, done.stdout)

    def test_the_command_says_what_is_wrong(self):
        for env, sentence in ((environment(), "asks who calls"),
                              (environment(VARIMESH_TOKEN=self.ann + "x"), "does not know this token"),
                              (environment(VARIMESH_TOKEN="a token\nof two lines"), "is not one line"),
                              (environment(VARIMESH_TOKEN_FILE=str(self.folder / "none")), "cannot be read")):
            done = run("jobs", "--server", self.server.address, env=env)
            self.assertIn(done.returncode, (2, 3), done.stderr)
            self.assertIn(sentence, done.stderr)
            self.assertNotIn(self.ann, done.stderr)
        done = self.call(self.reader, "submit", MESH)
        self.assertEqual(done.returncode, 2)
        self.assertIn("does not have the right to submit", done.stderr)

    def test_another_owners_job_is_not_there(self):
        done = self.call(self.ann, "submit", LARGER, *ENDLESS, "--active-set", "off", "--label", "case=wing", "--request-id", "one")
        self.assertEqual(done.returncode, 0, done.stderr)
        name = done.stdout.strip()
        for command in (["watch", name], ["cancel", name], ["delete", name], ["result", name, "-o", self.folder / "stolen.msh"],
                        ["wait", name]):
            done = self.call(self.bob, *command)
            self.assertNotEqual(done.returncode, 0, command)
            self.assertIn("There is no job", done.stderr)
        self.assertFalse((self.folder / "stolen.msh").exists())
        self.assertEqual(json.loads(self.call(self.bob, "jobs", "--json", "--label", "case=wing").stdout), {"jobs": []})
        done = self.call(self.bob, "submit", MESH, "--request-id", "one")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotEqual(done.stdout.strip(), name)
        listed = json.loads(self.call(self.reader, "jobs", "--json").stdout)["jobs"]
        self.assertEqual([(job["job"], job["owner"]) for job in listed], [(name, "ann")])
        self.assertEqual(self.call(self.ann, "cancel", name).returncode, 0)

    def test_tokens_are_replaced_while_watches_run(self):
        name = self.call(self.ann, "submit", LARGER, *ENDLESS, "--active-set", "off").stdout.strip()
        watches = [start("watch", name, "--server", self.server.address, env=environment(VARIMESH_TOKEN=self.ann))
                   for _ in range(50)]
        for watch in watches:
            self.addCleanup(watch.kill)
            self.assertTrue(watch.stderr.readline())
        self.file.write_text("")
        new = make_token(self.file, "ann", *EVERYTHING)
        deadline = time.monotonic() + 20
        while self.call(new, "jobs").returncode != 0:
            self.assertLess(time.monotonic(), deadline)
        self.assertIn("does not know this token", self.call(self.ann, "jobs").stderr)
        for watch in watches:
            self.assertIsNone(watch.poll(), "the watch was let in and goes on")
        self.assertEqual(self.call(new, "cancel", name).returncode, 0)
        for watch in watches:
            # The job's end is delivered; what the command asks for afterwards needs a token that is known.
            watch.communicate(timeout=20)
        (self.file).write_text("not a line of tokens\n")
        while "stay as they were" not in "".join(self.server.log):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        self.assertEqual(self.call(new, "jobs").returncode, 0)

    def test_a_check_of_the_state_knows_the_files_of_owners(self):
        state = self.folder / "state"
        server = Server("--tokens", str(self.file), "--state", str(state))
        done = run("submit", MESH, "--server", server.address, env=environment(VARIMESH_TOKEN=self.ann))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(server.stop()[0], 0)
        self.assertEqual(len(list((state / "meshes").glob("*.owners"))), 1)
        done = subprocess.run([VARIMESHD, "check", "--state", state], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_no_token_is_in_the_log(self):
        self.call(self.ann, "submit", MESH)
        self.call(self.reader, "submit", MESH)
        self.call("a-wrong-token", "jobs")
        self.assertEqual(self.server.stop()[0], 0)
        self.stopped = True
        log = "".join(self.server.log)
        self.assertIn("submitted", log)
        for secret in (self.ann, self.bob, self.reader, "a-wrong-token"):
            self.assertNotIn(secret, log)
            self.assertNotIn(hashlib.sha256(secret.encode()).hexdigest(), log)


@unittest.skipUnless(importlib.util.find_spec("grpc"), "python3-grpcio is missing (deploy/setup test)")
class CallingFromPython(CallingBase):
    """The Python client with the same server."""

    def setUp(self):
        super().setUp()
        for variable in ("VARIMESH_TOKEN", "VARIMESH_TOKEN_FILE"):
            os.environ.pop(variable, None)
            self.addCleanup(os.environ.pop, variable, None)

    def test_the_client_takes_tokens(self):
        import varimesh

        (self.folder / "token").write_text(self.ann + "\n")

        def works(**arguments):
            with varimesh.Client(self.server.address, **arguments) as client:
                return client.optimise(str(MESH)).valid

        self.assertTrue(works(token=self.ann))
        self.assertTrue(works(token_file=self.folder / "token"))
        os.environ["VARIMESH_TOKEN_FILE"] = str(self.folder / "token")
        self.assertTrue(works())
        os.environ["VARIMESH_TOKEN"] = "wrong"
        self.assertTrue(works(token_file=self.folder / "token"), "the argument comes first")
        with self.assertRaises(varimesh.Refused) as caught:
            works()
        self.assertEqual(caught.exception.reason, "TOKEN_UNKNOWN")
        with self.assertRaises(varimesh.Refused) as caught:
            works(token="")
        self.assertEqual(caught.exception.reason, "TOKEN_MISSING")
        with self.assertRaises(varimesh.BadOption):
            works(token_file=self.folder / "none")
        with self.assertRaises(varimesh.BadOption):
            works(token="two\nlines")

    def test_the_client_sees_only_its_owners_jobs(self):
        import varimesh

        with varimesh.Client(self.server.address, self.ann) as ann, varimesh.Client(self.server.address, self.bob) as bob:
            job = ann.submit(str(MESH))
            self.assertEqual(job.wait().owner, "ann")
            digest = ann.upload(str(MESH))
            for call in (lambda: bob.job(job.name), lambda: bob.download(digest)):
                with self.assertRaises(varimesh.Refused) as caught:
                    call()
                self.assertIn(caught.exception.reason, ("JOB_NOT_FOUND", "MESH_NOT_FOUND"))
            self.assertEqual(list(bob.jobs()), [])
            self.assertTrue(bob.optimise(str(MESH)).valid)


if __name__ == "__main__":
    unittest.main(verbosity=2)
