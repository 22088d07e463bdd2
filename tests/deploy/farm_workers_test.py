#!/usr/bin/env python3
"""The files of deploy/farm for workers outside containers: units of systemd, and the script for Slurm. A tool that is missing is
named, and its test is skipped.
  farm_workers_test.py Slurm|Systemd
"""
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from farm_files_test import FARM, TREE, VARIMESHD, flags_of_varimeshd


class Systemd(unittest.TestCase):
    def checked(self, name, key, wrong_key):
        """Has systemd read the unit with the file of this name beside it, as it is and with a wrong key in a key's place. Returns the
        texts of the unit and of the file."""
        with tempfile.TemporaryDirectory() as folder:
            unit, more = Path(folder) / "varimeshd.service", Path(folder) / "varimeshd.service.d" / name
            text = (TREE / "deploy" / "varimeshd.service").read_text()
            unit.write_text(text.replace("ExecStart=/usr/bin/varimeshd\n", f"ExecStart={VARIMESHD}\n"))
            more.parent.mkdir()
            added = (FARM / "systemd" / name).read_text()
            for faults, wrong in ((False, added), (True, added.replace(f"{key}=", f"{wrong_key}="))):
                more.write_text(wrong)
                checked = subprocess.run(["systemd-analyze", "verify", unit.name], capture_output=True, text=True, timeout=60,
                                         env={**os.environ, "SYSTEMD_UNIT_PATH": f"{folder}:"})
                self.assertEqual(f"'{wrong_key}'" in checked.stderr, faults, checked.stderr)
                if not faults:
                    self.assertEqual((checked.returncode, checked.stderr), (0, ""))
        return text, added

    def test_the_unit_of_a_worker_is_right(self):
        text, added = self.checked("worker.conf", "IPAddressAllow", "IPAddressesAllow")
        unset = re.findall(r"^UnsetEnvironment=(.*)$", added, re.MULTILINE)
        words = " ".join(re.findall(r"^Environment=(.*)$", text + added, re.MULTILINE)).split()
        variables = dict(word.split("=", 1) for word in words if word.startswith("VARIMESHD_"))
        for name in unset:
            del variables[name]
        kept = {key: value for key, value in os.environ.items() if not key.startswith("VARIMESH")}
        done = subprocess.run([VARIMESHD, "--print-config"], capture_output=True, text=True, timeout=20, env={**kept, **variables})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("# from the environment"), len(variables))

    def test_the_unit_with_devices_is_right(self):
        _, added = self.checked("devices.conf", "DeviceAllow", "DevicesAllow")
        self.assertIn("--devices", flags_of_varimeshd())
        self.assertIn("VARIMESHD_DEVICES=1", added)


class Slurm(unittest.TestCase):
    """Slurm itself is played: it gives the variables, sends the signal, and is told to queue the job again."""

    def test_a_worker_is_stopped_and_queued_again(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for program, body in (("varimeshd", f"echo $$ \"$@\" > {folder}/worker; trap 'sleep 1; echo done > {folder}/end; "
                                                "exit 0' TERM; while true; do sleep 0.1; done"),
                                  ("scontrol", f"echo \"$@\" > {folder}/requeued")):
                (folder / program).write_text(f"#!/bin/bash\n{body}\n")
                (folder / program).chmod(0o755)
            job = subprocess.Popen([FARM / "slurm" / "workers.sbatch"],
                                   env={"PATH": f"{folder}:{os.environ['PATH']}", "TMPDIR": name, "SLURM_JOB_ID": "17",
                                        "SLURM_CPUS_PER_TASK": "8", "SLURM_MEM_PER_NODE": "1000", "SLURM_GPUS_ON_NODE": "2",
                                        "VARIMESH_STORE": "s",
                                        "VARIMESH_MESHES": "m"})
            deadline = time.monotonic() + 20
            while not (folder / "worker").exists():
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.05)
            time.sleep(0.2)
            job.send_signal(signal.SIGTERM)
            self.assertEqual(job.wait(30), 0)
            self.assertTrue((folder / "end").exists(), "the script waits until the worker has ended")
            self.assertEqual((folder / "requeued").read_text(), "requeue 17\n")
            arguments = (folder / "worker").read_text().split()[1:]
            self.assertIn("--role worker", " ".join(arguments))
            self.assertEqual(arguments[arguments.index("--threads") + 1], "8")
            self.assertEqual(arguments[arguments.index("--devices") + 1], "2")
            self.assertEqual(int(arguments[arguments.index("--max-memory-bytes") + 1]), 943718400)
            self.assertLessEqual({word for word in arguments if word.startswith("--")}, flags_of_varimeshd())
            self.assertEqual(list(folder.glob("varimesh-*")), [], "its state is removed")

    def test_says_what_is_missing(self):
        done = subprocess.run([FARM / "slurm" / "workers.sbatch"], capture_output=True, text=True,
                              env={"PATH": os.environ["PATH"]}, timeout=30)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("VARIMESH_STORE", done.stderr)

if __name__ == "__main__":
    tool = {"Slurm": "bash", "Systemd": "systemd-analyze"}[sys.argv[1]]
    if shutil.which(tool) is None:
        print(f"SKIPPED: deploy/farm: {tool} is missing")
        sys.exit(77)
    unittest.main(verbosity=2)
