"""Tests tests/bench/paper in its short form: the command of each figure works, and its numbers are consistent.
ctest runs this with VARIMESH_BUILD and VARIMESH_SOURCE_DIR in the environment."""
import json
import os
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree
from pathlib import Path

SOURCE, BUILD = Path(os.environ["VARIMESH_SOURCE_DIR"]), Path(os.environ["VARIMESH_BUILD"])
PLANE = ["hyperelastic", "linear elastic", "distortion", "Winslow"]


def run(*arguments):
    # The short form must work without the meshes that are not part of the project.
    return subprocess.run([SOURCE / "tests" / "bench" / "paper", *map(str, arguments)], capture_output=True, text=True,
                          timeout=500, env=os.environ | {"VARIMESH_CASES": "/nowhere"})


def tables(text):
    """Each table as a list of rows; each row is a dictionary from the titles of the columns."""
    found, head = [], None
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if not cells:
            head = None
        elif head is None:
            head = cells
            found.append([])
        elif set(line) != {"|", "-"}:
            found[-1].append(dict(zip(head, cells)))
    return found


class Paper(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = Path(folder.name)

    def figure(self, name):
        done = run(name, "--short", "--build", BUILD, "--out", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(done.stdout.startswith(f"## {name}: "))
        return tables(done.stdout)

    def picture(self, name):
        return xml.etree.ElementTree.parse(self.out / f"{name}.svg").getroot().iter()

    def lines(self, name):
        return [element for element in self.picture(name) if element.tag.endswith("polyline")]

    def check_ends(self, rows):
        """Both elastic energies end above the distortion energy, and every energy ends with a valid mesh."""
        ends = {row["energy"]: float(row["min Js"]) for row in rows}
        self.assertGreater(min(ends.values()), 0)
        self.assertGreater(min(ends["hyperelastic"], ends["linear elastic"]), ends["distortion"])
        return ends


class Colouring(Paper):
    def test_counts_every_node_once(self):
        for row in self.figure("fig3-left")[0]:
            self.assertEqual(sum(map(int, row["by group: nodes per colour"].split(", "))), int(row["free nodes"]))
            self.assertGreaterEqual(int(row["by node: colours"]), int(row["most per element"]))
            self.assertEqual(len(row["by group: groups per colour"].split(", ")), int(row["by group: colours"]))
        program = BUILD / "tests" / "bench" / "figures" / "paper_colouring"
        colours = json.loads(subprocess.check_output([program, SOURCE / "tests" / "cases" / "nine_triangles.msh"]))
        self.assertEqual(colours["node"]["groups"], colours["node"]["nodes"])
        self.assertEqual(sum(colours["node"]["nodes"]), colours["free_nodes"])
        self.assertEqual(len(colours["node"]["nodes"]), colours["node"]["colours"])
        self.assertEqual(subprocess.run([program, self.out / "none.msh"], capture_output=True).returncode, 3)


class Scaling(Paper):
    def test_has_one_thread_and_all(self):
        rows = self.figure("fig3-right")[0]
        for colouring in ("node", "group"):
            threads = [int(row["threads"]) for row in rows if row["colouring"] == colouring]
            self.assertEqual((threads[0], threads[-1]), (1, os.cpu_count()))
        self.assertTrue(all(float(row["ten sweeps"].split()[0]) > 0 for row in rows))


class Convergence(Paper):
    def test_plane(self):
        for figure in ("fig4", "fig5"):
            rows = self.figure(figure)[0]
            self.assertEqual([row["energy"] for row in rows], PLANE)
            ends = self.check_ends(rows)
            self.assertEqual(ends["distortion"], ends["Winslow"])  # in the plane they differ only by a factor
            self.assertTrue(all(row["sweeps"] == "30" for row in rows))
        self.assertEqual(len(self.lines("fig5")), 2 * len(PLANE))

    def test_sphere(self):
        convergence, histograms = self.figure("fig7-8")
        self.check_ends(convergence)
        self.assertEqual(len(convergence), 6)
        self.assertEqual(len(self.lines("fig7")), 12)
        for row in histograms:
            self.assertEqual(sum(int(count) for column, count in row.items() if column != "scaled Jacobian"), 415)
        self.assertEqual([row["invalid"] for row in histograms], ["11"] + 6 * ["0"])
        self.assertGreater(len(list(self.picture("fig8"))), 30)

    def test_reference(self):
        ends = {row["energy"]: row for row in self.figure("reference")[0]}
        self.assertEqual(len(ends), 6)
        winslow = [ends[name]["aerofoil: min Js"] for name in ("Winslow, the paper's", "Winslow, the true one")]
        self.assertEqual(winslow, 2 * [ends["distortion"]["aerofoil: min Js"]])

    def test_stiffness(self):
        rows = [row for row in self.figure("stiffness")[0] if row["energy"].startswith("hyperelastic")]
        for mesh in ("aerofoil_p4", "sphere_p3"):
            ends = [float(row[f"{mesh}: min Js there"]) for row in rows]
            self.assertEqual(ends, sorted(ends))


class Pictures(Paper):
    def test_meshes(self):
        for figure, panels in (("fig4", 2), ("fig6", 5)):
            self.figure(figure)
            nested = [element for element in self.picture(figure) if element.tag.endswith("svg")][1:]
            self.assertEqual(len(nested), panels)
            for panel in nested:
                filled, edges = panel
                self.assertGreater(edges.get("d").count("M"), 10)
            invalid = [panel[0].get("d").count("M") for panel in nested]
            self.assertEqual(invalid, [2, 0, 0, 0, 0] if figure == "fig6" else [0, 0])


class Untangling(Paper):
    def test_nine_triangles(self):
        for row in self.figure("fig6")[0]:
            self.assertGreater(int(row["all valid after sweep"]), 1)

    def test_fewer_below_a_half(self):
        before, *after = self.figure("fig9")[0]
        self.assertEqual((before["invalid"], before["Js < 0.5"]), ("11", "66"))
        self.assertEqual(len(after), 4)
        for row in after:
            self.assertEqual(row["not certified valid"], "0")
            self.assertLess(int(row["Js < 0.5"]), 66)


class Command(Paper):
    def test_names_its_figures(self):
        done = run("--list")
        names = [line.split()[0] for line in done.stdout.splitlines()]
        self.assertEqual(" ".join(names), "fig3-left fig3-right fig4 fig5 fig6 fig7-8 reference stiffness fig9")
        self.assertEqual(run("fig10").returncode, 2)

    def test_says_what_is_missing(self):
        done = run("fig6", "--build", self.out, "--out", self.out)
        self.assertEqual(done.returncode, 1)
        self.assertIn("there is no", done.stderr)
        done = run("fig4", "--build", BUILD, "--out", self.out)
        self.assertEqual(done.returncode, 1)
        self.assertIn("set VARIMESH_CASES", done.stderr)


if __name__ == "__main__":
    unittest.main()
