"""The commands for the jobs of a server: submit, watch, result, jobs, cancel, delete and info."""
import fcntl
import json
import os
import pty
import struct
import subprocess
import termios
import unittest

from programs import ENDLESS, LARGER, MESH, Server, WithFolder, WithServer, run, start


class Jobs(WithServer):
    def test_a_job_is_submitted_watched_and_fetched(self):
        done = self.remote("submit", MESH, "--label", "for=test", "--request-id", "once")
        self.assertEqual(done.returncode, 0, done.stderr)
        job = done.stdout.strip()
        self.assertRegex(job, r"^jobs/[0-9a-f]{16}$")
        again = self.remote("submit", MESH, "--label", "for=test", "--request-id", "once")
        self.assertEqual(again.stdout.strip(), job)
        watched = self.remote("watch", job, "--json")
        self.assertEqual(watched.returncode, 0, watched.stderr)
        self.assertTrue(json.loads(watched.stdout)["converged"])
        out = self.folder / "out.msh"
        self.assertEqual(self.remote("result", job, "-o", out).returncode, 0)
        self.assertTrue(out.exists())
        jobs = json.loads(self.remote("jobs", "--label", "for=test", "--json").stdout)["jobs"]
        self.assertEqual([entry["job"] for entry in jobs], [job])
        self.assertEqual(jobs[0]["state"], "succeeded")

    def test_logs_are_what_has_happened_so_far(self):
        job = self.remote("submit", LARGER, *ENDLESS, "--label", "for=logs").stdout.strip()
        following = start("logs", job, "--follow", "--server", self.server.address, stdout=subprocess.PIPE)
        while not (entry := json.loads(self.remote("jobs", "--label", "for=logs", "--json").stdout)["jobs"][0]).get("iterations"):
            self.assertIn(entry["state"], ("pending", "running"))
        early = self.remote("logs", job)  # does not wait for the end
        self.assertEqual(early.returncode, 0, early.stderr)
        self.assertRegex(early.stdout, r"^\d{4}-\d\d-\d\dT[\d:.]+Z  pending\n\S+Z  running\n")
        self.assertNotIn("cancelled", early.stdout)
        self.remote("cancel", job)
        whole, _ = following.communicate(timeout=40)
        self.assertRegex(whole, r"Z  sweeps +2 .*min Js[^\n]*not certified")
        self.assertRegex(whole, r"Z  cancelled\n$")
        self.assertEqual(self.remote("logs", job, "--follow").stdout, whole)
        documents = [json.loads(line) for line in self.remote("logs", job, "--json").stdout.splitlines()]
        self.assertEqual(len(documents), len(whole.splitlines()))
        self.assertEqual(documents[-1]["stateChange"]["state"], "JOB_STATE_CANCELLED")
        self.assertEqual(self.remote("jobs", "--label", "for=logs", "--names").stdout, job + "\n")

    def test_jobs_have_names_times_and_files(self):
        job = self.remote("submit", MESH, "--label", "for=list").stdout.strip()
        self.remote("watch", job, "--quiet")
        (entry,) = json.loads(self.remote("jobs", "--label", "for=list", "--json").stdout)["jobs"]
        self.assertEqual((entry["file"], entry["labels"]), (MESH.name, {"file": MESH.name, "for": "list"}))
        self.assertEqual(entry["iterations"], entry["metrics"]["iterations"])
        for time in ("submitted", "began", "ended"):
            self.assertRegex(entry[time], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")
        head, row = self.remote("jobs", "--label", "for=list").stdout.splitlines()
        self.assertEqual(head.split(), ["JOB", "STATE", "SUBMITTED", "RAN", "ITERATIONS", "FILE", "AND", "LABELS"])
        self.assertRegex(row, rf"^{job} +succeeded +\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d +\d+\.\d s +\d+  {MESH.name}  for=list$")
        named = self.remote("submit", MESH, "--label", "file=another")
        self.assertEqual(named.returncode, 0, named.stderr)
        self.assertIn("no such jobs", self.remote("jobs", "--label", "for=nothing").stderr)

    def test_the_beginning_of_a_name_is_enough(self):
        job = self.remote("submit", MESH, "--label", "for=short").stdout.strip()
        others = [entry["job"] for entry in json.loads(self.remote("jobs", "--json").stdout)["jobs"] if entry["job"] != job]

        def shortest():
            return next(job[:n] for n in range(6, len(job)) if not any(other.startswith(job[:n]) for other in others))

        short = shortest()
        for name in (short, short.removeprefix("jobs/")):
            self.assertEqual(self.remote("watch", name, "--quiet").returncode, 0)
        waited = self.remote("wait", short, job)
        self.assertEqual((waited.returncode, waited.stdout.count(job)), (0, 1), waited.stderr)
        # Among 17 names, two begin with the same letter.
        for _ in range(17 - len(others)):
            others.append(self.remote("submit", MESH).stdout.strip())
        firsts = [name[:6] for name in [*others, job]]
        twice = next(first for first in firsts if firsts.count(first) > 1)
        refused = self.remote("cancel", twice)
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertRegex(refused.stderr, rf"jobs have names that begin with '{twice}', such as .*; write more of the name")
        self.assertEqual(self.remote("delete", shortest()).returncode, 0)
        self.assertIn("There is no job", self.remote("cancel", job).stderr)

    def test_a_table_on_a_terminal_is_as_wide_as_the_terminal(self):
        job = self.remote("submit", MESH, "--label", "for=width", "--label", "about=" + "ü" * 60).stdout.strip()
        self.remote("watch", job, "--quiet")
        for columns, fits in ((80, False), (250, True)):
            master, terminal = pty.openpty()
            fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 30, columns, 0, 0))
            done = subprocess.run([os.environ["VARIMESH"], "jobs", "--label", "for=width", "--server", self.server.address],
                                  stdout=terminal, timeout=60)
            os.close(terminal)
            lines = os.read(master, 10000).decode().splitlines()
            os.close(master)
            self.assertEqual((done.returncode, len(lines)), (0, 2), lines)
            self.assertLessEqual(max(map(len, lines)), columns)
            shown = job if fits else job.removeprefix("jobs/")[:8]  # every command takes the first digits
            self.assertTrue(lines[1].startswith(shown + "  "), lines[1])
            self.assertEqual(self.remote("watch", shown, "--quiet").returncode, 0)
            self.assertIn(MESH.name[:10], lines[1])
            self.assertEqual(lines[1].endswith("…"), not fits, lines[1])

    def test_an_address_needs_a_port_or_a_path(self):
        for address in ("foo", "v.sock"):
            refused = run("jobs", "--server", address)
            self.assertEqual(refused.returncode, 2)
            self.assertIn(f"The address '{address}' has no port; write HOST:PORT or unix:PATH.", refused.stderr)

    def test_without_a_server_info_knows_the_plugin(self):
        plugin = json.loads(run("doctor", "--json").stdout)["CAD plugin"]["found"]
        info = json.loads(run("info", "--json", "--server", "").stdout)
        self.assertEqual(info["takes_geometries"], not plugin.startswith("missing"))

    def test_an_address_may_look_like_a_browser_s(self):
        address = self.server.address
        self.assertEqual(run("jobs", "--server", f"http://{address}/").returncode, 0)
        refused = run("jobs", "--server", f"https://{address}")
        self.assertEqual(refused.returncode, 5)
        self.assertIn("speaks no TLS", refused.stderr)

    def test_the_address_has_a_default_in_the_environment(self):
        os.environ["VARIMESH_SERVER"] = self.server.address
        try:
            self.assertEqual(run("jobs").returncode, 0)
            out = self.folder / "out.msh"
            self.assertEqual(run("optimize", MESH, "-o", out, "--request-id", "by-environment").returncode, 0)
            self.assertIn("by-environment", run("jobs", "--json").stdout)
            # Without an address, the command does the work itself.
            self.assertEqual(run("optimise", MESH, "-o", out, "--server", "", "--request-id", "here").returncode, 0)
            self.assertNotIn('"here"', run("jobs", "--json").stdout)
        finally:
            del os.environ["VARIMESH_SERVER"]
        self.assertEqual(run("jobs").returncode, 2)

    def test_a_straight_mesh_of_higher_order_is_said_to_be_straight(self):
        straight, out = self.folder / "straight.msh", self.folder / "out.msh"
        self.assertEqual(run("optimise", MESH, "-o", straight, "--order", "1").returncode, 0)
        raised = run("optimise", straight, "-o", out, "--order", "3")
        self.assertIn("its boundary is still straight", raised.stderr)
        self.assertIn("before it is optimised", raised.stderr)
        self.assertNotIn("still straight", run("optimise", MESH, "-o", out, "--order", "5").stderr)

    def test_a_job_that_runs_is_not_deleted(self):
        job = self.remote("submit", LARGER, *ENDLESS).stdout.strip()
        refused = self.remote("delete", job)
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertIn(f"{job} has not ended; cancel it first.", refused.stderr)
        self.assertEqual(self.remote("cancel", job).returncode, 0)
        self.assertEqual(self.remote("watch", job, "--quiet").returncode, 1)
        self.assertEqual(self.remote("delete", job).returncode, 0)

    def test_a_priority_is_kept_and_has_bounds(self):
        job = self.remote("submit", MESH, "--priority", "7", "--json")
        self.assertEqual(json.loads(job.stdout)["priority"], 7)
        self.assertEqual(self.remote("submit", MESH, "--priority", "101").returncode, 2)

    def test_info_lists_the_energies(self):
        facts = json.loads(self.remote("info", "--json").stdout)
        self.assertIn("hyperelastic", facts["energies"])

    def test_an_unknown_job_is_a_usage_error(self):
        self.assertEqual(self.remote("watch", "jobs/none").returncode, 2)


class Watch(WithFolder):
    def test_an_event_that_does_not_exist_is_refused(self):
        server = Server()
        try:
            job = run("submit", MESH, "--server", server.address).stdout.strip()
            self.assertEqual(run("watch", job, "--server", server.address).returncode, 0)
            ahead = run("watch", job, "--after", 99999, "--server", server.address)
            self.assertEqual((ahead.returncode, ahead.stdout), (2, ""), ahead.stderr)
            self.assertRegex(ahead.stderr, r"has no event number 99999: its last is \d+;")
            out = self.folder / "out.msh"
            lost = run("result", job, "-o", out, "--history", self.folder / "missing" / "history.csv", "--server",
                       server.address)
            self.assertEqual(lost.returncode, 3, lost.stderr)
            self.assertIn("history.csv", lost.stderr)
            self.assertFalse(out.exists())
            document = run("watch", job, "--json", "--server", server.address)
            self.assertTrue(json.loads(document.stdout)["converged"])
        finally:
            server.stop()


class Submit(WithFolder):
    def test_a_submission_that_is_refused_for_now_is_repeated(self):
        server = Server("--threads", "1", "--max-pending-jobs-per-peer", "1")
        submit = ["submit", LARGER, *ENDLESS, "--server", server.address]
        for _ in range(2):  # One runs, one waits.
            waiting = run(*submit)
            self.assertEqual(waiting.returncode, 0, waiting.stderr)
        third = start(*submit, stdout=subprocess.PIPE)
        with self.assertRaises(subprocess.TimeoutExpired):
            third.wait(1)
        run("cancel", waiting.stdout.strip(), "--server", server.address)
        out, err = third.communicate(timeout=40)
        self.assertEqual(third.returncode, 0, err)
        self.assertRegex(out, r"^jobs/")
        self.assertEqual(server.stop()[0], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
