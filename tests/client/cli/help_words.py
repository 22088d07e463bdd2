"""The commands and options that the help lists, for the tests of what is made from the same facts."""
import re
import subprocess

from programs import run

COMMANDS = re.findall(r"^  ([a-z]+) ", run("--help").stdout.split("\nCommands:\n")[1].split("\n\n")[0], re.MULTILINE)
OPTIONS = re.findall(r"^  (--[a-z-]+)", run("optimise", "--help-all").stdout.split("\nOptimisation:\n")[1], re.MULTILINE)


def shell(name, *arguments):
    """Runs another program."""
    return subprocess.run([name, *map(str, arguments)], capture_output=True, text=True, timeout=30)
