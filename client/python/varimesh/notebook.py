"""What a notebook shows of a result: a picture of the histogram and the figures, as HTML with an SVG inside."""
from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .reports import Quality

if TYPE_CHECKING:
    from .job import Result

_WIDTH, _HEIGHT, _BARS = 480, 150, 25
_BEFORE, _AFTER = "#c9771b", "#2a6fb0"


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


def page(result: Result) -> str:
    """The HTML of a result."""
    before, after, metrics = result.before, result.after, result.metrics
    rows = (
        ("smallest scaled Jacobian", f"{before.min_scaled_jacobian:.4f}", f"{after.min_scaled_jacobian:.4f}"),
        ("mean scaled Jacobian", f"{before.mean_scaled_jacobian:.4f}", f"{after.mean_scaled_jacobian:.4f}"),
        ("certified valid", str(before.certified.valid), str(after.certified.valid)),
        ("certified invalid", str(before.certified.invalid), str(after.certified.invalid)),
        ("undecided", str(before.certified.undecided), str(after.certified.undecided)),
    )
    table = "".join(f"<tr><td>{name}</td><td>{one}</td><td>{other}</td></tr>" for name, one, other in rows)
    how = html.escape(f"{metrics.elements} elements, {metrics.iterations} iterations in {metrics.seconds:.3g} s, "
                      f"{metrics.stop_reason}")  # fmt: skip
    return (f"<div><div><b>{html.escape(result.job)}</b>: {how}</div>"
            "<div>Cells by scaled Jacobian (square root of their number): "
            f'<span style="color:{_BEFORE}">before</span>, <span style="color:{_AFTER}">after</span></div>'
            f"{_picture(before, after)}"
            f"<table><tr><th></th><th>before</th><th>after</th></tr>{table}</table></div>")  # fmt: skip
