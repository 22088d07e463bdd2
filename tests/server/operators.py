"""What the tests of an operator's work with varimeshd share."""
import os
import subprocess
import time

from programs import VARIMESHD


def environment(**variables):
    kept = {key: value for key, value in os.environ.items() if not key.startswith("VARIMESH") or key == "VARIMESH_SOURCE_DIR"}
    return {**kept, **variables}


def varimeshd(*words, **variables):
    return subprocess.run([VARIMESHD, *map(str, words)], capture_output=True, text=True, timeout=20,
                          env=environment(**variables))


def wait_until(holds, seconds=20):
    deadline = time.monotonic() + seconds
    while not (value := holds()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return value
