"""The server program as a user meets it: its flags, its addresses, and how it ends."""
import contextlib
import signal
import os
import re
import sqlite3
import subprocess
import time
import unittest

from programs import ENDLESS, LARGER, MESH, VARIMESHD, Server, WithFolder, run, start, wait_for_line


class Varimeshd(WithFolder):
    def test_suggests_the_flag_for_a_misspelt_one(self):
        for word, meant in (("--max-memory-byte", "'--max-memory-bytes'"), ("--listn=x", "'--listen'"),
                            ("--qqqq", "varimeshd --help")):
            done = subprocess.run([VARIMESHD, word], capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2)
            self.assertIn(meant, done.stderr)

    def test_help_has_examples_and_headings_and_the_manual_has_the_same(self):
        shown, manual = (subprocess.run([VARIMESHD, word], capture_output=True, text=True, check=True, timeout=20).stdout
                         for word in ("--help", "man"))
        self.assertIn("\nExamples:\n  # serve the programs of this user on this machine\n  varimeshd\n", shown)
        self.assertLessEqual(max(map(len, shown.splitlines())), 100)
        headings = re.findall(r"^([A-Z].*):$", shown, re.MULTILINE)
        self.assertEqual(headings[0], "Examples")
        sections = re.findall(r"^\.SS (.*)$", manual, re.MULTILINE)[1:]
        self.assertGreaterEqual(len(sections), 5)
        self.assertEqual(headings[-len(sections):], sections)
        options = re.findall(r"^  (?:-\w, )?(--[a-z-]+)", shown, re.MULTILINE)
        self.assertGreater(len(options), 40)
        for option in options:
            self.assertIn("\\fB" + option.replace("-", "\\-") + "\\fR", manual)
        for shell in ("bash", "zsh", "fish"):
            script = subprocess.run([VARIMESHD, "completion", shell], capture_output=True, text=True, check=True).stdout
            for option in options:
                self.assertIn(option if shell != "fish" else f"-l {option[2:]}", script)
        completed = subprocess.run(["bash", "-c", f"source <({VARIMESHD} completion bash); COMP_WORDS=(varimeshd --max-mesh); "
                                    "COMP_CWORD=1; _varimeshd; echo ${COMPREPLY[@]}"], capture_output=True, text=True)
        self.assertEqual(completed.stdout, "--max-mesh-bytes\n", completed.stderr)

    def test_the_examples_of_the_help_are_accepted(self):
        shown = subprocess.run([VARIMESHD, "--help"], capture_output=True, text=True, check=True, timeout=20).stdout
        calls = [call.split()[1:] for line in re.findall(r"^  (varimeshd.*)$", shown[: shown.index("\nUsage:")], re.MULTILINE)
                 for call in line.split(" && ")]
        self.assertEqual(len(calls), 7)
        for words in calls:
            with self.subTest(" ".join(words)):
                if words[:1] != ["token"] and "--print-config" not in words:
                    words.append("--print-config")  # no server starts
                done = subprocess.run([VARIMESHD, *words], cwd=self.folder, capture_output=True, text=True, timeout=20)
                self.assertEqual(done.returncode, 0, done.stderr)

    def test_refuses_addresses_beyond_loopback(self):
        done = subprocess.run([VARIMESHD, "--listen", "0.0.0.0:0"], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--insecure", done.stderr)

    def test_a_second_server_on_the_port_is_refused(self):
        server = Server()
        self.addCleanup(server.stop)
        second = subprocess.run([VARIMESHD, "--listen", server.address], capture_output=True, text=True, timeout=20)
        self.assertEqual(second.returncode, 1, second.stderr)
        self.assertIn("taken", second.stderr)
        self.assertEqual(len(second.stderr.splitlines()), 1, "nothing is said of a server that does not start")

    def test_sigterm_with_a_job_and_a_watcher_ends_in_order(self):
        server = Server()
        client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
        wait_for_line(client, "residual")
        status, left = server.stop()
        self.assertEqual((status, left), (0, []), "".join(server.log))
        client.send_signal(signal.SIGINT)  # The client waits for the server to come back.
        client.communicate(timeout=30)
        self.assertIn(client.returncode, (1, 5, 130))

    def test_the_port_file_is_not_written_through_links(self):
        for planted in ("address", "address.new"):
            with self.subTest(planted):
                folder = self.folder / planted
                folder.mkdir()
                victim, port_file = folder / "victim", folder / "address"
                victim.write_text("untouched")
                (folder / planted).symlink_to(victim)
                process = subprocess.Popen([VARIMESHD, "--listen", "127.0.0.1:0", "--port-file", port_file, "--log-level",
                                            "off", "--data", folder])
                self.addCleanup(lambda process=process: process.poll() is None and process.kill())
                deadline = time.monotonic() + 20
                while port_file.is_symlink() or not port_file.exists():
                    self.assertIsNone(process.poll())
                    self.assertLess(time.monotonic(), deadline)
                    time.sleep(0.01)
                self.assertEqual(run("info", "--server", port_file.read_text().strip()).returncode, 0)
                process.terminate()
                self.assertEqual(process.wait(20), 0)
                self.assertEqual(victim.read_text(), "untouched")
                self.assertEqual(list(folder.glob("*.part-*")), [])

    def test_only_the_owner_may_use_a_socket(self):
        path = self.folder / "socket"
        process = subprocess.Popen([VARIMESHD, "--listen", f"unix:{path}", "--log-level", "off"],
                                   stdout=subprocess.PIPE, text=True)
        self.assertIn("unix:", process.stdout.readline())
        self.assertEqual(path.stat().st_mode & 0o777, 0o600)
        self.assertEqual(run("info", "--server", f"unix:{path}").returncode, 0)
        process.terminate()
        self.assertEqual(process.wait(20), 0)
        process.stdout.close()

    def test_the_state_has_a_default_in_the_environment(self):
        state = self.folder / "state"
        process = subprocess.Popen([VARIMESHD, "--listen", "127.0.0.1:0", "--log-level", "off"], stdout=subprocess.PIPE,
                                   text=True, env={**os.environ, "VARIMESH_STATE": str(state)})
        process.stdout.readline()
        process.terminate()
        self.assertEqual(process.wait(20), 0)
        process.stdout.close()
        self.assertTrue(any(state.iterdir()))

    def maintain(self, *words):
        return subprocess.run([VARIMESHD, *words], capture_output=True, text=True, timeout=60)

    def test_a_backup_of_a_running_server_is_a_state_of_its_own(self):
        state, copy = self.folder / "state", self.folder / "copy"
        server = Server("--state", state)
        done = run("submit", MESH, "--server", server.address)
        self.assertEqual(run("watch", done.stdout.strip(), "--server", server.address).returncode, 0)
        waiting = run("submit", LARGER, *ENDLESS, "--server", server.address).stdout.strip()
        backup = self.maintain("backup", "--state", state, copy)
        self.assertEqual(backup.returncode, 0, backup.stdout + backup.stderr)
        self.assertIn("2 jobs and ", backup.stdout)
        self.assertIn("another varimeshd uses it", self.maintain("check", "--state", state).stderr)
        server.stop()
        for each in (state, copy):
            check = self.maintain("check", "--state", each)
            self.assertEqual(check.returncode, 0, check.stdout + check.stderr)
            self.assertIn("nothing is damaged", check.stdout)
        server = Server("--state", copy)
        self.addCleanup(server.stop)
        jobs = run("jobs", "--server", server.address).stdout
        self.assertIn(done.stdout.strip(), jobs)
        self.assertEqual(run("cancel", waiting, "--server", server.address).returncode, 0)

    def test_a_backup_keeps_the_earlier_one_from_damage(self):
        state, copy = self.folder / "state", self.folder / "copy"
        server = Server("--state", state)
        done = run("submit", MESH, "--server", server.address)
        self.assertEqual(run("watch", done.stdout.strip(), "--server", server.address).returncode, 0)
        server.stop()
        self.assertEqual(self.maintain("backup", "--state", state, copy).returncode, 0)
        swapped = self.maintain("backup", "--state", copy, state)
        self.assertEqual(swapped.returncode, 1)
        self.assertIn("is no backup", swapped.stderr)
        names = sorted(path.name for path in (copy / "meshes").iterdir())
        mesh = max((copy / "meshes").iterdir(), key=lambda path: path.stat().st_size)
        whole = mesh.read_bytes()
        mesh.write_bytes(whole[:-1])
        owners = f"{names[0].removesuffix('.zst')}.owners"
        (state / "meshes" / owners).write_text("0" * 64 + "\n")
        again = self.maintain("backup", "--state", state, copy)
        self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
        self.assertIn("(1 copied now)", again.stdout)
        self.assertEqual(mesh.read_bytes(), whole)
        self.assertTrue((copy / "meshes" / owners).exists())
        with contextlib.closing(sqlite3.connect(state / "jobs.sqlite")) as database, database:
            database.execute("UPDATE jobs SET sum = 7")
        damaged = self.maintain("backup", "--state", state, copy)
        self.assertEqual(damaged.returncode, 1, damaged.stdout + damaged.stderr)
        self.assertIn("was not replaced", damaged.stdout)
        check = self.maintain("check", "--state", copy)
        self.assertEqual(check.returncode, 0, check.stdout + check.stderr)
        self.assertEqual(sorted(path.name for path in (copy / "meshes").iterdir()), sorted([*names, owners]))

    def test_check_finds_and_repairs_a_damaged_file(self):
        state = self.folder / "state"
        server = Server("--state", state)
        done = run("submit", MESH, "--server", server.address)
        self.assertEqual(run("watch", done.stdout.strip(), "--server", server.address).returncode, 0)
        server.stop()
        damaged = max((state / "meshes").iterdir(), key=lambda path: path.stat().st_size)
        damaged.write_bytes(damaged.read_bytes()[:-1])
        check = self.maintain("check", "--state", state, "--repair")
        self.assertEqual(check.returncode, 1, check.stdout + check.stderr)
        self.assertIn(f"The file {damaged.name} is damaged and was moved to", check.stdout)
        self.assertTrue((state / "damaged" / damaged.name).exists())
        self.assertEqual(self.maintain("check").returncode, 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
