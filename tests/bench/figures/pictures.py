"""Small SVG pictures: curves by sweep, histograms, and plane meshes with curved edges."""
import math
from html import escape

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # colour-blind people can tell them apart
DASHES = ("none", "8 6", "2 8", "none", "8 6", "none")  # curves that lie on each other can both be seen
TEXT = 'font-family="sans-serif" font-size="12" fill="#222"'


def document(width, height, parts):
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
            f'<rect width="{width}" height="{height}" fill="#fff"/>' + "\n".join(parts) + "</svg>\n")


def text(x, y, words, anchor="middle", more=""):
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {TEXT} {more}>{escape(words)}</text>'


def thinned(points, place):
    """The points that are at least two units apart, and the last point. `place` maps the first coordinate to units."""
    kept = points[:1]
    for point in points:
        if place(point[0]) >= place(kept[-1][0]) + 2 or point is points[-1]:
            kept.append(point)
    return kept


def ticks(low, high):
    """About five round numbers between `low` and `high`."""
    step = 10 ** math.floor(math.log10(high - low))
    step = next(step * part for part in (1, .5, .2, .1) if (high - low) / (step * part) >= 4)
    return [round(i * step, 9) for i in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def axis_of_sweeps(x0, width, last, logarithmic):
    """A function from a sweep to its place on the axis, and the marks of the axis."""
    if logarithmic:
        decades = max(math.log10(last), 1e-6)
        return (lambda sweep: x0 + width * math.log10(sweep) / decades,
                [10 ** power for power in range(int(decades + 1e-9) + 1)])
    return lambda sweep: x0 + width * sweep / last, ticks(0, last)


def axis_of_values(y0, height, values, logarithmic):
    """A function from a value to its place on the axis, and the marks of the axis with their labels."""
    low, high = min(values), max(values)
    if logarithmic:  # a residual is never 0, because the tolerance is above it
        low, high = math.floor(math.log10(low)), math.ceil(math.log10(high))
        marks = [(10.0 ** power, f"1e{power}" if power else "1") for power in range(low, high + 1)]
        marks = marks[::max(1, len(marks) // 6)]
    else:
        low, high = min(low, high - 1e-6), max(high, low + 1e-6)
        marks = [(value, f"{value:g}") for value in ticks(low, high)]
    scaled = math.log10 if logarithmic else float
    return lambda value: y0 + height * (1 - (scaled(value) - low) / (high - low)), marks


def panel(x0, y0, width, height, title, curves, logarithmic_sweeps, logarithmic_values):
    """A panel of curves over the number of sweeps; each curve is a list of (sweep, value)."""
    across, sweeps = axis_of_sweeps(x0, width, max(curve[-1][0] for curve in curves), logarithmic_sweeps)
    up, values = axis_of_values(y0, height, [value for curve in curves for _, value in curve], logarithmic_values)
    parts = [text(x0 + width / 2, y0 - 10, title), text(x0 + width / 2, y0 + height + 34, "sweep")]
    for sweep in sweeps:
        parts += [f'<path d="M{across(sweep):.1f} {y0}v{height}" stroke="#ddd"/>',
                  text(across(sweep), y0 + height + 17, f"{sweep:g}")]
    for value, words in values:
        parts += [f'<path d="M{x0} {up(value):.1f}h{width}" stroke="#ddd"/>', text(x0 - 6, up(value) + 4, words, "end")]
    for colour, dash, curve in sorted(zip(COLOURS, DASHES, curves), key=lambda one: one[1] != "none"):
        path = " ".join(f"{across(sweep):.1f},{up(value):.1f}" for sweep, value in thinned(curve, across))
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2" '
                     f'stroke-dasharray="{dash}"/>')
    parts.append(f'<rect x="{x0}" y="{y0}" width="{width}" height="{height}" fill="none" stroke="#888"/>')
    return parts


def legend(x, y, names):
    """A legend with three names per row."""
    parts = []
    for i, (colour, dash, name) in enumerate(zip(COLOURS, DASHES, names)):
        left, line = x + i % 3 * 270, y + i // 3 * 20
        parts += [f'<path d="M{left} {line - 4}h32" stroke="{colour}" stroke-width="3" stroke-dasharray="{dash}"/>',
                  text(left + 38, line, name, "start")]
    return parts


def convergence(path, runs):
    """Draws residual and smallest scaled Jacobian by sweep; `runs` are pairs of a name and a Run."""
    column = lambda name: [[(line["iteration"], line[name]) for line in run.history] for _, run in runs]
    path.write_text(document(900, 320 + 20 * ((len(runs) + 2) // 3), [
        *panel(60, 40, 370, 230, "residual", column("residual"), False, True),
        *panel(510, 40, 370, 230, "smallest scaled Jacobian at the quadrature points", column("min_scaled_jacobian"),
               True, False),
        *legend(60, 330, [name for name, _ in runs])]))


def histograms(path, bins):
    """Draws elements by scaled Jacobian, two bins per bar; `bins` are pairs of a name and the counts of 50 bins of [0, 1]."""
    width, height, gap = 260, 150, 40
    parts = []
    bars = [[first + second for first, second in zip(counts[::2], counts[1::2])] for _, counts in bins]
    most = max(max(counts) for counts in bars)
    for i, ((name, _), counts) in enumerate(zip(bins, bars)):
        x0, y0 = 40 + i % 3 * (width + gap), 30 + i // 3 * (height + 60)
        parts += [text(x0 + width / 2, y0 - 8, name), f'<path d="M{x0} {y0 + height}h{width}" stroke="#888"/>']
        parts += [text(x0 + width * js, y0 + height + 16, f"{js:g}") for js in (0, .5, 1)]
        parts.append(text(x0 - 4, y0 + 10, f"{most}", "end"))
        step = width / len(counts)
        for k, count in enumerate(counts):
            if count:
                bar = max(1, height * count / most)
                parts.append(f'<rect x="{x0 + k * step + 1:.1f}" y="{y0 + height - bar:.1f}" width="{step - 2:.1f}" '
                             f'height="{bar:.1f}" fill="{COLOURS[0]}"/>')
    rows = (len(bins) + 2) // 3
    path.write_text(document(40 + 3 * (width + gap), 20 + rows * (height + 60), parts))


class PlaneMesh:
    """The triangles of an MSH 2.2 file in ASCII, with the nodes of their edges."""

    TYPES = {2: 1, 9: 2, 21: 3, 23: 4, 25: 5}  # from gmsh's number of the element type to its order

    def __init__(self, path):
        lines = iter(path.read_text().splitlines())
        self.nodes, self.triangles = {}, {}  # by number
        for line in lines:
            if line == "$Nodes":
                for _ in range(int(next(lines))):
                    number, x, y, _ = next(lines).split()
                    self.nodes[int(number)] = (float(x), float(y))
            elif line == "$Elements":
                for _ in range(int(next(lines))):
                    number, kind, tags, *rest = map(int, next(lines).split())
                    if kind in self.TYPES:
                        self.triangles[number] = self.edges(rest[tags:], self.TYPES[kind])

    @staticmethod
    def edges(nodes, order):
        """The nodes of the three edges from end to end. Gmsh lists the vertices first, then the inner nodes of each edge."""
        inside = order - 1
        return [(nodes[i], *nodes[3 + i * inside:3 + (i + 1) * inside], nodes[(i + 1) % 3]) for i in range(3)]

    def curve(self, edge, pieces=8):
        """Points on the edge, whose nodes are equispaced in the parameter. Only its two ends if the edge is straight."""
        nodes = [self.nodes[number] for number in edge]
        order = len(nodes) - 1
        (ax, ay), (bx, by) = nodes[0], nodes[-1]
        length2 = (bx - ax) ** 2 + (by - ay) ** 2
        if all(abs((x - ax) * (by - ay) - (y - ay) * (bx - ax)) < 1e-3 * length2 for x, y in nodes):
            return [nodes[0], nodes[-1]]
        points = []
        for step in range(pieces + 1):
            t = order * step / pieces
            weights = [math.prod((t - j) / (i - j) for j in range(order + 1) if j != i) for i in range(order + 1)]
            points.append(tuple(sum(w * node[k] for w, node in zip(weights, nodes)) for k in (0, 1)))
        return points


def mesh_panel(x0, y0, width, height, title, mesh, window, marked=()):
    """The part of a plane mesh inside window = (left, bottom, right, top); the elements in `marked` are filled."""
    left, bottom, right, top = window
    scale = min(width / (right - left), height / (top - bottom))
    place = lambda x, y: f"{(x - left) * scale:.1f},{(top - y) * scale:.1f}"
    seen, edges, filled = set(), [], []
    for number, triangle in mesh.triangles.items():
        outline = []
        for edge in triangle:
            points = mesh.curve(edge)
            outline += points[:-1]
            near = (max(x for x, _ in points) > left and min(x for x, _ in points) < right and
                    max(y for _, y in points) > bottom and min(y for _, y in points) < top)
            ends = tuple(sorted((edge[0], edge[-1])))
            if near and ends not in seen:
                seen.add(ends)
                edges.append("M" + "L".join(place(*point) for point in points))
        if number in marked:
            filled.append("M" + "L".join(place(*point) for point in outline) + "Z")
    return [text(x0 + width / 2, y0 - 8, title),
            f'<svg x="{x0}" y="{y0}" width="{width}" height="{height}"><path d="{"".join(filled)}" fill="#f4b0a0"/>'
            f'<path d="{"".join(edges)}" fill="none" stroke="#333"/></svg>',
            f'<rect x="{x0}" y="{y0}" width="{width}" height="{height}" fill="none" stroke="#888"/>']


def meshes(path, panels, window, width=280):
    """Draws `panels`, which are (title, PlaneMesh, marked elements), side by side, three per row."""
    height = round(width * (window[3] - window[1]) / (window[2] - window[0]))
    parts = []
    for i, (title, mesh, marked) in enumerate(panels):
        parts += mesh_panel(10 + i % 3 * (width + 20), 30 + i // 3 * (height + 40), width, height, title, mesh, window,
                            marked)
    rows, columns = (len(panels) + 2) // 3, min(3, len(panels))
    path.write_text(document(columns * (width + 20), rows * (height + 40) + 5, parts))
