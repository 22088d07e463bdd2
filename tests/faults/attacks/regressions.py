"""Attacks that are default tests of their own, because they need hostile code, a bucket, a full disk or nobody who works."""
import os
import re
import subprocess
from pathlib import Path

BUILT = Path(os.environ["VARIMESHD"]).parents[1]

# The name of each row, and regular expressions for the names of its tests.
TESTS = {
    "hostile code in each sandbox": ["server.isolation.Captured"],
    "what a captured process says": [r"server.Said\..*", r"server.ChannelTest\..*", r"server.PlainTexts\..*", "fuzz.captured"],
    "memory in turns": [r"server.MemoryBudget.*", r"core.memory.MemoryOfReading\..*",
                        "server.CoreEngine.AsksForMoreMemoryOnlyIfTheMeshTurnsOutToNeedIt"],
    "meshes that cannot be read": [r"server.DamagedMesh\..*", r"server.ComparedFile\..*", r"server.Check\..*"],
    "sizes that cannot be": ["server.SizeOfAMesh.*"],
    "a full disk": ["faults.FullDisk", r"server.FullDisk\..*", "server.SqliteJobs.KeepsItsRoomAlsoAfterARestart"],
    "long tags of XML": [r"core.formats.Xml\..*"],
    "digests of others": [r"server.Owners\..*", r"server.DirectoryOwners\..*"],
    "state directories": [r"server.StateDirectoryTest\..*", r"server.Restart\..*"],
    "HTTP ports": [r"server.admin\..*"],
    "certificates": [r"client.tls.*", r"server.tls.*"],
    "watches through nginx": ["deploy.nginx"],
    "buckets": [r"server.s3\..*"],
    "files of a farm": [r"deploy.farm\..*", r"server.postgres.PostgresAddress\..*"],
}


def of(row, tests):
    """A row that runs these tests."""

    class Regression:
        name = row
        alone = True

        def __init__(self, short):
            pass

        def run(self):
            """Returns the exit status, and how many tests passed."""
            wanted = "^(" + "|".join(tests) + ")$"
            done = subprocess.run(["ctest", "--test-dir", str(BUILT), "--no-tests=error", "--output-on-failure", "-R", wanted],
                                  capture_output=True, text=True)
            failed = re.findall(r"^\s*\d+ - (\S+) \((?!Skipped)", done.stdout, re.MULTILINE)
            said = re.findall(r"^\d+% tests passed.*", done.stdout, re.MULTILINE)
            skipped = [f"{done.stdout.count('***Skipped')} skipped"] if "***Skipped" in done.stdout else []
            return done.returncode, [*said, *skipped, *failed] or (done.stdout + done.stderr).splitlines()[-3:]

    return Regression


ROWS = [of(row, tests) for row, tests in TESTS.items()]
