"""The paper's figures, one function per figure. It yields Markdown, and writes pictures and histories to Bench.out."""
import os

import pictures
from runs import PAPER, SWEEPS, elements_below

HYPERELASTIC = ("hyperelastic", ("--energy", "hyperelastic"))
LINEAR = ("linear elastic", ("--energy", "linear-elastic"))
DISTORTION = ("distortion", ("--energy", "distortion"))
WINSLOW = ("Winslow", ("--energy", "winslow"))
PLANE = (HYPERELASTIC, LINEAR, DISTORTION, WINSLOW)
SMALL = ("linear elastic, small strain", ("--energy", "linear-elastic", "--strain", "small"))
PRINTED = ("Winslow, the paper's", ("--energy", "winslow", "--winslow", "paper"))  # |F|²/J also in 3-D
SPATIAL = (HYPERELASTIC, LINEAR, SMALL, DISTORTION, PRINTED, ("Winslow, the true one", WINSLOW[1]))


def table(*rows):
    head, *body = [f"| {' | '.join(map(str, row))} |" for row in rows]
    return "\n".join([head, "|" + "---|" * len(rows[0]), *body, ""])


def title(mesh):
    return mesh.name.split(".")[0]


def known(number):
    return "–" if number is None else number


def colouring(bench):
    """Fig. 3, left: the number of colours and the nodes per colour, by node and by group"""
    rows = [("mesh", "free nodes", "most per element", "by node: colours", "nodes per colour: most, median, least",
             "colours with under 1 % of the nodes", "by group: colours", "by group: groups per colour",
             "by group: nodes per colour")]
    for name in ("naca524_p5", "circ10k_p5", "sph276_p5", "sph10k_p4"):
        colours = bench.colours(bench.mesh(name))
        node, group = colours["node"], colours["group"]
        counts = sorted(node["nodes"], reverse=True)
        few = [count for count in counts if count < 0.01 * colours["free_nodes"]]
        rows.append((title(bench.mesh(name)), colours["free_nodes"], colours["most_free_nodes_of_a_cell"],
                     node["colours"], f"{counts[0]}, {counts[len(counts) // 2]}, {counts[-1]}",
                     f"{len(few)} with {sum(few)} nodes", group["colours"], ", ".join(map(str, group["groups"])),
                     ", ".join(map(str, group["nodes"]))))
    yield table(*rows)


def scaling(bench):
    """Fig. 3, right: ten sweeps of the sphere of 10,472 tetrahedra on one core and on all"""
    mesh, most = bench.mesh("sph10k_p4"), os.cpu_count()
    counts = sorted({min(2 ** power, most) for power in range(most.bit_length() + 1)})
    rows = [("colouring", "threads", "ten sweeps", "speed-up", "rate of that many one-thread runs at once",
             "share of that", "processor seconds")]
    for colouring in ("node", "group"):
        options = (*SWEEPS, "--colouring", colouring, "--max-iterations", 10, "--tolerance", 1e-15)
        seconds, together, processor = {}, {}, {}
        least = lambda table, threads, value: table.update({threads: min(table.get(threads, value), value)})
        for _ in range(1 if bench.short else 3):  # in turns, so that other work disturbs all alike; the best counts
            for threads in counts:
                run = bench.optimise(mesh, "fig3", *options, threads=threads)
                least(seconds, threads, 10 * run.seconds_per_sweep)
                least(processor, threads, run.processor_seconds)
                several = [bench.start(mesh, f"fig3_{i}", (*options, "--threads", 1)) for i in range(threads)]
                least(together, threads, max(10 * take().seconds_per_sweep for take in several))
        for threads in counts:
            rate = threads * min(seconds[1], together[1]) / together[threads]
            speedup = seconds[1] / seconds[threads]
            rows.append((colouring, threads, f"{seconds[threads]:.3g} s", f"{speedup:.2f}", f"{rate:.2f} times as much",
                         f"{100 * speedup / rate:.0f} %", f"{processor[threads]:.3g}"))
    yield table(*rows)


def convergence_rows(runs):
    yield ("energy", "sweeps to a residual of 1e-4", "1e-6", "1e-8", "all valid after sweep", "sweeps",
           "residual at the end", "sweeps per decade at the end", "min Js", "mean Js", "processor seconds")
    for name, run in runs:
        after = run.document["after"]
        yield (name, *(known(run.sweeps_to(residual)) for residual in (1e-4, 1e-6, 1e-8)),
               known(run.first(lambda line: line["invalid_elements"] == 0)), run.document["iterations"],
               f"{run.document['residual']:.1e}", f"{run.sweeps_per_decade:.0f}",
               f"{after['min_scaled_jacobian']:.4f}", f"{after['mean_scaled_jacobian']:.4f}",
               f"{run.processor_seconds:.3g}")


def start_row(run):
    mesh, before = run.document["mesh"], run.document["before"]
    return (f"{mesh['elements']} elements of order {mesh['order']}, {mesh['free_nodes']} free nodes; at the start "
            f"min Js {before['min_scaled_jacobian']:.4f}, mean {before['mean_scaled_jacobian']:.4f}, "
            f"{before['invalid_elements']} invalid\n")


def by_energies(bench, figure, mesh, energies, sweeps):
    """Runs the paper's method with each energy."""
    return [(name, bench.by_the_paper(bench.mesh(mesh), f"{figure}_{i}", sweeps, *options))
            for i, (name, options) in enumerate(energies)]


def plane_mesh(bench, mesh, name):
    """The mesh in a form that can be drawn, and the numbers of its invalid elements."""
    out = bench.out / f"{name}_drawn.msh"
    bench.convert(mesh, out)
    return pictures.PlaneMesh(out), {element["number"] for element in bench.quality(mesh)["invalid"]}


def aerofoil(bench):
    """Fig. 4: the NACA 0012 aerofoil at order 5"""
    runs = by_energies(bench, "fig4", "naca524_p5", PLANE, 1000)
    yield start_row(runs[0][1])
    yield table(*convergence_rows(runs))
    long = by_energies(bench, "fig4_long", "naca524_p5", (HYPERELASTIC, DISTORTION), 15000)
    levels = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    yield table(("energy, for longer", *(f"sweeps to {level:.0e}" for level in levels), "sweeps per decade at the end"),
                *((name, *(known(run.sweeps_to(level)) for level in levels), f"{run.sweeps_per_decade:.0f}")
                  for name, run in long))
    panels = [(words, *plane_mesh(bench, mesh, f"fig4_{i}")) for i, (words, mesh) in enumerate(
        (("before", bench.mesh("naca524_p5")), ("hyperelastic, 1,000 sweeps", runs[0][1].mesh)))]
    pictures.meshes(bench.out / "fig4.svg", panels, (-0.15, -0.2, 0.45, 0.2), 430)


def circle(bench):
    """Fig. 5: residual and min Js by sweep on the circle of 10,000 triangles"""
    runs = by_energies(bench, "fig5", "circ10k_p5", PLANE, 1000)
    yield start_row(runs[0][1])
    yield table(*convergence_rows(runs))
    pictures.convergence(bench.out / "fig5.svg", runs)


def nine_triangles(bench):
    """Fig. 6: nine triangles, two of them inverted, untangled by each energy"""
    runs = by_energies(bench, "fig6", "nine_triangles", PLANE, 1000)
    yield start_row(runs[0][1])
    yield table(*convergence_rows(runs))
    panels = [("before", *plane_mesh(bench, bench.mesh("nine_triangles"), "fig6_before"))]
    panels += [(name, *plane_mesh(bench, run.mesh, f"fig6_{i}")) for i, (name, run) in enumerate(runs)]
    pictures.meshes(bench.out / "fig6.svg", panels, (-0.3, -0.1, 2.3, 1.7))


def sphere(bench):
    """Figs 7 and 8: a sphere in a cube, convergence and histograms, with the paper's Winslow energy and the true one"""
    runs = by_energies(bench, "fig7", "sph276_p5", SPATIAL, 1000)
    yield start_row(runs[0][1])
    yield table(*convergence_rows(runs))
    pictures.convergence(bench.out / "fig7.svg", runs)
    judged = [("before", bench.quality(bench.mesh("sph276_p5")))]
    judged += [(name, bench.quality(run.mesh)) for name, run in runs]
    yield table(("scaled Jacobian", "invalid", *(f"{k / 10:.1f} to {(k + 1) / 10:.1f}" for k in range(10))),
                *((name, quality["invalid_elements"], *(sum(quality["histogram"][5 * k:5 * k + 5]) for k in range(10)))
                  for name, quality in judged))
    pictures.histograms(bench.out / "fig8.svg", [(name, quality["histogram"]) for name, quality in judged
                                                 if "small" not in name])


def stiffness(bench):
    """The explanation of Figs 4 to 8: how stiff an energy is against changes of volume, compared with changes of shape"""
    # The ratio at F = 1 of the second derivative for a displacement along the direction in which it varies to that for a
    # displacement across this direction.
    mu = 1 / 2.8
    softer, stiffer = ([(f"{ratio:.2f}", f"hyperelastic, λ = {ratio - 2:.3g} μ",
                         (*HYPERELASTIC[1], "--mu", mu, "--lambda", mu * (ratio - 2)), True) for ratio in ratios]
                       for ratios in ((2.001, 4), (12, 30)))
    energies = [("1.00", *WINSLOW, True), ("1.00 (2-D), 1.33 (3-D)", *DISTORTION, True), ("2.00", *PRINTED, False),
                *softer, ("6.67", *LINEAR, True), ("6.67", *HYPERELASTIC, True), *stiffer]
    rows = [("ratio", "energy", *(f"{title(bench.mesh(name))}: {what}" for name in ("naca524_p5", "sph276_p5")
                                  for what in ("sweeps to 1e-6", "min Js there", "mean Js")))]
    for i, (ratio, energy, options, plane) in enumerate(energies):
        row = [ratio, energy]
        for name, wanted in (("naca524_p5", plane), ("sph276_p5", True)):
            if not wanted:
                row += ["", "", ""]
                continue
            run = bench.optimise(bench.mesh(name), f"stiffness_{i}", *PAPER, *options, "--max-iterations",
                                 bench.sweeps(5000))
            row += [run.document["iterations"] if run.document["converged"] else "–", f"{run.min_js:.4f}",
                    f"{run.document['after']['mean_scaled_jacobian']:.4f}"]
        rows.append(row)
    yield table(*rows)


def reference(bench):
    """The tests of the reference implementation: its aerofoil and its sphere at order 3, to a residual of 1e-9"""
    rows = [("energy", "aerofoil: min Js", "sphere: min Js", "sphere: mean Js")]
    for name, options in SPATIAL:
        plane, space = (bench.optimise(bench.mesh(mesh), mesh, "--constants", "reference", "--order", 3,
                                       "--tolerance", 1e-9, *options)
                        for mesh in ("reference_naca524_p3", "reference_sphere276_p4"))
        rows.append((name, f"{plane.min_js:.4f}", f"{space.min_js:.4f}",
                     f"{space.document['after']['mean_scaled_jacobian']:.4f}"))
    yield table(*rows)


def aircraft(bench):
    """Fig. 9: the DLR-F6, elements with a scaled Jacobian below 0.5 before and after"""
    mesh = bench.mesh("dlrf6_p4")
    rows = [("", "iterations", "processor seconds", "Js < 0.5", "invalid", "not certified valid",
             "of these unrepairable", "min Js", "mean Js")]

    def row(what, run, quality):
        done = (run.document["iterations"], f"{run.processor_seconds:.3g}") if run else (0, "")
        certified = quality["certified"]
        return (what, *done, elements_below(quality, 0.5), quality["invalid_elements"],
                certified["invalid"] + certified["undecided"], len(quality["unrepairable"]),
                f"{quality['min_scaled_jacobian']:.3f}", f"{quality['mean_scaled_jacobian']:.4f}")

    own = lambda name, *options: bench.optimise(mesh, name, "--constants", "reference", *options)
    runs = [("the paper's method", bench.by_the_paper(mesh, "fig9_paper", 20)),
            ("default method, `--until valid`", own("fig9_valid", "--until", "valid")),
            ("the same, `--repair split`", own("fig9_split", "--until", "valid", "--repair", "split")),
            ("default method, to 1e-6 or for ten minutes", own("fig9_default", "--time-limit", 600))]
    rows.append(row("before", None, bench.quality(mesh)))
    rows += [row(what, run, bench.quality(run.mesh)) for what, run in runs]
    document = runs[0][1].document["mesh"]
    yield f"{document['elements']} elements of order {document['order']}, {document['free_nodes']} free nodes\n"
    yield table(*rows)


FIGURES = {"fig3-left": colouring, "fig3-right": scaling, "fig4": aerofoil, "fig5": circle, "fig6": nine_triangles,
           "fig7-8": sphere, "reference": reference, "stiffness": stiffness,
           "fig9": aircraft}
