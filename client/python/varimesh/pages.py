"""HTML of a result: the report, which is the page that `varimesh result --report` writes, and what a notebook shows."""
from __future__ import annotations

import html
import os
import subprocess
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import BadOutput, ServerUnreachable
from .names import counted
from .reports import Quality
from .requirements import find_program

if TYPE_CHECKING:
    from .job import Result

# Exit statuses of the command.
_UNCERTIFIED, _NO_SERVER = 4, 5
#: The report of a larger mesh is not shown without being asked for, because the notebook would have to keep it.
MOST_ELEMENTS = 20_000
#: How long a notebook waits for a report that it shows without being asked for.
MOST_SECONDS = 20.0
_LAST_WORDS = 5.0  # seconds
_WIDTH, _HEIGHT, _BARS = 480, 150, 25
_BEFORE, _AFTER = "#c9771b", "#2a6fb0"


def is_page(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a report by its ending."""
    return os.path.splitext(path)[1].lower() in (".html", ".htm")


def find_command() -> str:
    """The path of the command `varimesh`: from VARIMESH, in this package, or from PATH."""
    found = find_program("varimesh", "VARIMESH")
    if found is None:
        raise BadOutput("The command 'varimesh' writes reports, and it is not here or cannot be run; install varimesh-client, or "
                        "set VARIMESH to its path.")  # fmt: skip
    return found


def write_report(job: str, path: str | os.PathLike[str], environment: Mapping[str, str | None],
                 seconds: float | None = None) -> None:  # fmt: skip
    """Writes the report of a job. `environment` says where its server is and what it must be shown; None: not set. If
    `seconds` are not enough, there is no report."""
    around = {**os.environ, **{key: value for key, value in environment.items() if value is not None}}
    for key, value in environment.items():
        if value is None:
            around.pop(key, None)
    command = [find_command(), "result", job, "--report", os.fspath(path), "--quiet"]
    try:
        process = subprocess.Popen(command, env=around, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True, errors="replace")  # fmt: skip
    except OSError as error:
        raise BadOutput(f"The command {command[0]} cannot be run: {error.strerror}.") from error
    try:
        said = process.communicate(timeout=seconds)[1].strip()
    except subprocess.TimeoutExpired:
        raise BadOutput(f"The report was not ready within {seconds:g} s; the server may be busy.") from None
    finally:
        _end(process)
    if process.returncode in (0, _UNCERTIFIED):
        return
    sentence = said.removeprefix("varimesh: ") or f"{command[0]} ended with status {process.returncode}."
    raise (ServerUnreachable if process.returncode == _NO_SERVER else BadOutput)(sentence)


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a command that nobody waits for any more, and lets it remove what it made on the server."""
    if process.poll() is None:
        process.terminate()
        try:
            process.communicate(timeout=_LAST_WORDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


# ===== in a notebook =====


def _heights(quality: Quality) -> NDArray[np.float64]:
    """The cells per bar. The bins of the report are merged."""
    heights: NDArray[np.float64] = quality.histogram.reshape(_BARS, -1).sum(axis=1).astype(np.float64)
    return heights


def _bars(heights: NDArray[np.float64], most: float, color: str, shift: float) -> str:
    width = _WIDTH / _BARS
    # Square roots, so that a few poor cells are seen beside thousands of good ones.
    tall = np.sqrt(heights / most) * (_HEIGHT - 4)
    return "".join(f'<rect x="{i * width + shift:.1f}" y="{_HEIGHT - h:.1f}" width="{width / 2 - 1:.1f}" height="{h:.1f}" '
                   f'fill="{color}"/>' for i, h in enumerate(tall) if h > 0)  # fmt: skip


def _picture(before: Quality, after: Quality) -> str:
    ours, theirs = _heights(before), _heights(after)
    most = max(1.0, ours.max(initial=0), theirs.max(initial=0))
    ticks = "".join(f'<text x="{x * _WIDTH:.0f}" y="{_HEIGHT + 14}" text-anchor="{anchor}" font-size="11" '
                    f'fill="currentColor">{x:g}</text>'
                    for x, anchor in ((0, "start"), (0.25, "middle"), (0.5, "middle"), (0.75, "middle"), (1, "end")))  # fmt: skip
    return (f'<svg role="img" aria-label="Scaled Jacobians of the cells before and after" viewBox="0 0 {_WIDTH} '
            f'{_HEIGHT + 18}" width="{_WIDTH}" height="{_HEIGHT + 18}">'
            + _bars(ours, most, _BEFORE, 0.5) + _bars(theirs, most, _AFTER, _WIDTH / _BARS / 2)
            + f'<line x1="0" x2="{_WIDTH}" y1="{_HEIGHT}" y2="{_HEIGHT}" stroke="currentColor"/>{ticks}</svg>')  # fmt: skip


def framed(report: str) -> str:
    """The report as a part of another page. It may run its own scripts, and touches nothing outside."""
    return (f'<iframe title="Report of the mesh" sandbox="allow-scripts" srcdoc="{html.escape(report)}" '
            'style="width:100%;height:720px;border:1px solid #ccc"></iframe>')  # fmt: skip


def of_notebook(result: Result, report: str | None = None) -> str:
    """The HTML of a result; `report`: its report, if that is to be shown too."""
    before, after, metrics = result.before, result.after, result.metrics
    rows = (
        ("smallest scaled Jacobian", f"{before.min_scaled_jacobian:.4f}", f"{after.min_scaled_jacobian:.4f}"),
        ("mean scaled Jacobian", f"{before.mean_scaled_jacobian:.4f}", f"{after.mean_scaled_jacobian:.4f}"),
        ("certified valid", str(before.certified.valid), str(after.certified.valid)),
        ("certified invalid", str(before.certified.invalid), str(after.certified.invalid)),
        ("undecided", str(before.certified.undecided), str(after.certified.undecided)),
    )
    table = "".join(f"<tr><td>{name}</td><td>{one}</td><td>{other}</td></tr>" for name, one, other in rows)
    picture = "" if report is None else framed(report)
    how = html.escape(f"{counted(metrics.elements, 'element')}, {counted(metrics.iterations, 'iteration')} in {metrics.seconds:.3g} s, "
                      f"{metrics.stop_reason}")  # fmt: skip
    return (f"<div><div><b>{html.escape(result.job)}</b>: {how}</div>"
            "<div>Cells by scaled Jacobian (square root of their number): "
            f'<span style="color:{_BEFORE}">before</span>, <span style="color:{_AFTER}">after</span></div>'
            f"{_picture(before, after)}"
            f"<table><tr><th></th><th>before</th><th>after</th></tr>{table}</table>{picture}</div>")  # fmt: skip
