"""Settings of varimeshd from its command line, the environment and a file."""
import unittest

from operators import varimeshd
from programs import MESH, Server, WithFolder, run


class Settings(WithFolder):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "varimeshd.conf"

    def settings(self, *words, **variables):
        done = varimeshd(*words, "--print-config", **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_one_key_has_one_name_everywhere(self):
        self.assertIn("\n# max-priority = 100\n", self.settings())
        self.assertIn("\nmax-priority = 7  # from the command line\n", self.settings("--max-priority", "7"))
        self.assertIn("\nmax-priority = 8  # from the environment\n", self.settings(VARIMESHD_MAX_PRIORITY="8"))
        self.file.write_text("# a comment\n\n  max-priority =9 # another\ninsecure = true\n"
                             f"state = \"{self.folder}/with spaces # and more\"\n")
        said = self.settings("--config", self.file)
        self.assertIn(f"\nmax-priority = 9  # from '{self.file}'\n", said)
        self.assertIn("\ninsecure = true  # from ", said)
        self.assertIn(f"\nstate = \"{self.folder}/with spaces # and more\"  # from ", said)
        self.assertEqual(said, self.settings(VARIMESHD_CONFIG=str(self.file)))

    def test_the_command_line_goes_before_the_environment_and_that_before_the_file(self):
        self.file.write_text("max-priority = 1\nthreads = 2\nmax-watches-per-peer = 3\n")
        said = self.settings("--config", self.file, "--max-priority", "4", VARIMESHD_MAX_PRIORITY="5", VARIMESHD_THREADS="6",
                             VARIMESH_STATE="/old/name")
        for line in ("max-priority = 4  # from the command line", "threads = 6  # from the environment",
                     "max-watches-per-peer = 3  # from '", "state = /old/name  # from the environment"):
            self.assertIn("\n" + line, said)
        said = self.settings(VARIMESH_STATE="/old/name", VARIMESHD_STATE="/new/name")
        self.assertIn("\nstate = /new/name  # from the environment", said)

    def test_what_is_printed_is_a_file_with_the_same_settings(self):
        said = self.settings("--max-priority", "7", "--insecure", "--log-level", "warn", "--state", self.folder / "a b",
                             "--port-file", "both \" and '")
        self.assertIn("\nport-file = 'both \" and '''  # from", said)
        self.file.write_text(said)
        again = self.settings("--config", self.file)
        strip = lambda text: [line.split("  # from")[0] for line in text.splitlines()]
        self.assertEqual(strip(again), strip(said))

    def test_unknown_keys_and_wrong_values_are_refused(self):
        for text, words in (("max-prioritie = 1", ("Line 1 of ", "did you mean 'max-priority'?")),
                            ("threads = 1\nqqqq = 2", ("Line 2 of ", "no setting")),
                            ("max-priority = 1000", ("In the configuration file", "--max-priority")),
                            ("max-priority", ("Line 1 of ", "key = value")), ("max-priority =", ("key = value",)),
                            ("[server]", ("key = value",)), ("state = \"/a", ("key = value",)),
                            ("state = \"/a\" b", ("key = value",)), ("help = true", ("no setting",)),
                            ("config = x", ("no setting",)), ("--threads = 1", ("no setting",))):
            self.file.write_text(text)
            done = varimeshd("--config", self.file, "--print-config")
            self.assertEqual((done.returncode, done.stdout), (2, ""), text)
            for word in words:
                self.assertIn(word, done.stderr, text)
        done = varimeshd("--print-config", VARIMESHD_MAX_PRIORITIE="1")
        self.assertEqual(done.returncode, 2)
        self.assertIn("did you mean 'VARIMESHD_MAX_PRIORITY'?", done.stderr)
        of_kubernetes = {"VARIMESHD_SERVICE_HOST": "10.0.0.7", "VARIMESHD_PORT_50051_TCP": "tcp://10.0.0.7:50051"}
        self.assertEqual(varimeshd("--print-config", **of_kubernetes).returncode, 2)
        self.assertEqual(varimeshd("--print-config", KUBERNETES_SERVICE_HOST="10.0.0.1", **of_kubernetes).returncode, 0)
        done = varimeshd("--print-config", VARIMESHD_THREADS="many")
        self.assertEqual(done.returncode, 2)
        self.assertIn("In the environment", done.stderr)
        done = varimeshd("--print-config", VARIMESHD_PORT_FILE="two\nlines")
        self.assertEqual(done.returncode, 2)
        self.assertIn("'--port-file' has a line break", done.stderr)
        done = varimeshd("--config", self.folder / "none")
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot be read", done.stderr)
        self.assertEqual(varimeshd("--config", self.folder).returncode, 2)

    def test_a_server_starts_with_them(self):
        self.file.write_text(f"state = {self.folder}/state\nlog-format = json\nmax-job-iterations = 7\n")
        server = Server("--config", str(self.file))
        self.addCleanup(server.stop)
        self.assertTrue((self.folder / "state").is_dir())
        refused = run("submit", MESH, "--max-iterations", "8", "--server", server.address)
        self.assertIn("7", refused.stderr)
        self.assertNotEqual(refused.returncode, 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
