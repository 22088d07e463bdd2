"""The runs behind the paper's figures: their meshes, options and results."""
import csv
import json
import math
import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

# The paper's method, with the constants of the paper's implementation.
SWEEPS = ("--constants", "reference", "--method", "sweeps", "--active-set", "off")
PAPER = (*SWEEPS, "--colouring", "node")

# With --short, these meshes of tests/cases replace those of the figures.
STAND_INS = {"naca524_p5": "aerofoil_p4", "reference_naca524_p3": "aerofoil_p4", "circ10k_p5": "circle_p5",
             "sph276_p5": "sphere_p3", "sph10k_p4": "sphere_p3", "reference_sphere276_p4": "sphere_p3",
             "dlrf6_p4": "sphere_p3"}

NOT_CERTIFIED = 4  # the command's exit status if the result is written and some elements are not certified valid


class Trouble(Exception):
    """An error that is reported to the user in a sentence."""


@dataclass
class Run:
    """The result of one optimisation."""
    document: dict  # what --json printed
    history: list   # one dictionary of numbers per iteration
    mesh: Path      # the result
    processor_seconds: float = 0  # of the whole command; 0 if several ran at the same time

    @property
    def min_js(self):
        return self.document["after"]["min_scaled_jacobian"]

    def first(self, condition):
        """The number of the first iteration that fulfils the condition, or None."""
        return next((int(line["iteration"]) for line in self.history if condition(line)), None)

    def sweeps_to(self, residual):
        return self.first(lambda line: line["residual"] <= residual)

    @property
    def sweeps_per_decade(self):
        """How many sweeps lower the residual to a tenth, over the second half of the sweeps whose residual is above rounding."""
        residuals = [line["residual"] for line in self.history if line["residual"] > 1e-13]
        half = len(residuals) // 2
        decades = math.log10(residuals[half] / residuals[-1])
        return (len(residuals) - 1 - half) / decades if decades > 0 else math.inf

    @property
    def seconds_per_sweep(self):
        """The median over all sweeps except the first."""
        times = [line["seconds"] for line in self.history]
        steps = sorted(after - before for before, after in zip(times, times[1:]))
        return steps[len(steps) // 2]


def start(*command):
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process):
    """Waits for the process, and returns what it printed."""
    output, errors = process.communicate()
    if process.returncode not in (0, NOT_CERTIFIED):
        raise Trouble(f"{' '.join(map(str, process.args))} ended with status {process.returncode}: {errors.strip()}")
    return output


class Bench:
    """Finds programs and meshes, and runs the programs. With `short` a figure takes seconds instead of minutes."""

    def __init__(self, build, out, short):
        self.varimesh = build.absolute() / "client" / "varimesh"
        self.colouring = build.absolute() / "tests" / "bench" / "figures" / "paper_colouring"
        for program in (self.varimesh, self.colouring):
            if not program.exists():
                raise Trouble(f"there is no {program}; without --build it is built in build/release")
        self.cases = Path(os.environ.get("VARIMESH_CASES", ROOT.parent / "shared" / "cases")).absolute()
        self.out, self.short = out.absolute(), short
        self.out.mkdir(parents=True, exist_ok=True)

    def mesh(self, name):
        """The path of a mesh. If it does not exist, generate.py makes it first."""
        ours = ROOT / "tests" / "cases" / f"{STAND_INS.get(name, name) if self.short else name}.msh"
        if ours.exists():
            return ours
        made = self.out / "meshes"
        for folder in (self.cases / "meshes", made):  # "b" stands for binary
            for version in ("", ".41b", ".22b"):
                if (folder / f"{name}{version}.msh").exists():
                    return folder / f"{name}{version}.msh"
        script = self.cases / "generate.py"
        if not script.exists():
            raise Trouble(f"{name}: there is no {script}; set VARIMESH_CASES to the folder that contains it")
        print(f"making {name}", file=sys.stderr)
        part = self.out / f"{name}.part"
        part.mkdir(exist_ok=True)
        done = subprocess.run(["/usr/bin/python3", script, name], env=os.environ | {"OUT": str(part)},
                              capture_output=True, text=True)
        found = sorted(part.glob("*.msh"))
        if done.returncode or not found:
            raise Trouble(f"{name}: generate.py did not make it (it needs Debian's python3-gmsh): "
                          f"{done.stderr or done.stdout}")
        made.mkdir(exist_ok=True)
        return found[0].rename(made / found[0].name)

    def sweeps(self, number):
        return min(number, 30) if self.short else number

    def start(self, mesh, name, options):
        """Starts an optimisation, whose files get `name`. Returns a function that waits for the Run."""
        out, history = self.out / f"{name}.msh", self.out / f"{name}.csv"
        process = start(self.varimesh, "optimise", mesh, "-o", out, "--history", history, "--json", "--quiet",
                        *map(str, options))
        return lambda: self.take(finish(process), history, out)

    def take(self, output, history, out):
        number = lambda text: text if text.replace("-", "").isalpha() else float(text)
        with history.open(newline="") as file:
            lines = [{name: number(text) for name, text in line.items()} for line in csv.DictReader(file)]
        return Run(json.loads(output), lines, out)

    def optimise(self, mesh, name, *options, threads=1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run = self.start(mesh, name, (*options, "--threads", threads))()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        run.processor_seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return run

    def by_the_paper(self, mesh, name, sweeps, *options):
        """Runs this many sweeps of the paper's method, whatever the residual."""
        return self.optimise(mesh, name, *PAPER, *options, "--max-iterations", self.sweeps(sweeps),
                             "--tolerance", 1e-15)

    def quality(self, mesh):
        """What `varimesh quality` says, and which of the elements that are not certified valid are unrepairable."""
        document = json.loads(finish(start(self.varimesh, "quality", mesh, "--diagnose", "--json")))
        unrepairable = {element for group in document["unrepairable"] for element in group["elements"]}
        quality = document["quality"]
        quality["unrepairable"] = sorted(unrepairable & {element["number"] for element in quality["uncertified"]})
        return quality

    def convert(self, mesh, out):
        finish(start(self.varimesh, "convert", mesh, out, "--format", "msh22"))

    def colours(self, mesh):
        return json.loads(finish(start(self.colouring, mesh)))


def elements_below(quality, js):
    """How many elements have a scaled Jacobian below `js`, including the invalid ones; `js` is the edge of a bin."""
    bins = round(js * len(quality["histogram"]))
    return quality["invalid_elements"] + sum(quality["histogram"][:bins])
