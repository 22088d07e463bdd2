"""Shows the progress of a job on standard error: one changing line on a terminal, plain lines elsewhere."""
from __future__ import annotations

import math
import shutil
import sys
import time
from typing import TextIO

from .events import Event, Iteration, Work

_WIDTH = 16


class Progress:
    """Takes a job's events and shows them. If the stream is not a terminal, it prints at most one line per second,
    without control characters."""

    def __init__(self, tolerance: float = 1e-3, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._tolerance = tolerance
        self._end: float | None = None  # when the job will end, on the monotonic clock
        self._share: float | None = None  # of its time has passed
        self._known = (0.0, 0.0)  # the seconds that had passed, and the share, when the end was known last
        self._first = 0.0
        self._number = 0
        self._began = time.monotonic()
        self._shown = -math.inf
        self._open = False

    def __call__(self, event: Event) -> None:
        if event.iteration is not None:
            self._show(event.iteration)
        elif event.work is not None:
            self._show_work(event.work)
        elif event.state is not None:
            self._line(event.state)
        elif event.log is not None:
            self._line(event.log)
        elif event.slide_trial is not None:
            trial = event.slide_trial
            self._line(f"slide {trial.slide}: {trial.outcome}")

    def _line(self, text: str) -> None:
        if self._open:
            self._stream.write("\r\x1b[K")
        self._open = False
        self._stream.write(text + "\n")
        self._stream.flush()

    def seconds_left(self) -> float | None:
        """The seconds left, as the job itself said last, counted down. None if it cannot tell, or if its server is older."""
        return None if self._end is None else max(0.0, self._end - time.monotonic())

    def _left(self, seconds: float | None) -> str:
        """Takes what a message says, and puts it in words."""
        self._end = None if seconds is None else time.monotonic() + seconds
        return "" if seconds is None else f"  about {seconds:.0f} s left"

    def _show(self, now: Iteration) -> None:
        left = self._left(now.seconds_left)
        self._first = self._first or now.residual
        self._number = now.number
        if not self._is_due():
            return
        # The mesh of an iteration is a trial if cells would go back to where they are certified.
        trial = now.invalid_elements != now.left_elements or (now.left_elements == 0 and now.min_scaled_jacobian <= 0)
        smallest = "" if trial else f"  min Js <= {now.min_scaled_jacobian:>7.4f}"
        head, residual = f"{now.phase} {now.number:>4}", f"  residual {now.residual:.2e}"
        quality, seconds = f"{smallest}  not certified {now.left_elements}", f"  {now.seconds:.1f} s"
        if not self._terminal:
            self._line(head + residual + quality + seconds + left)
            return
        if now.seconds_left is not None:
            self._share = max(self._share or 0.0, now.seconds / max(now.seconds + now.seconds_left, 1e-9))
            self._known = (now.seconds, self._share)
        elif self._share is not None and now.seconds > self._known[0]:
            passed, share = self._known
            self._share = max(self._share, share + (1 - share) * (1 - passed / now.seconds))
        share = self._fallen(now.residual) if self._share is None else self._share
        filled = int(_WIDTH * min(1.0, max(0.0, share)))
        bar = "[" + "#" * filled + "." * (_WIDTH - filled) + "] "
        self._draw(bar + head + residual + quality + seconds + left, bar + head + quality + seconds + left,
                   head + quality + seconds + left, head + quality + left, head + quality, head)

    def _fallen(self, residual: float) -> float:
        """How far the residual has fallen towards the tolerance. It says how far a job has come that cannot tell its end."""
        if residual <= self._tolerance:
            return 1.0
        if not self._first > self._tolerance > 0:
            return 0.0
        return math.log(self._first / residual) / math.log(self._first / self._tolerance)

    def _show_work(self, work: Work) -> None:
        left = self._left(work.seconds_left)
        # A short run shows its iterations, and nothing of what is inside them.
        if time.monotonic() < self._began + self._interval() or not self._is_due():
            return
        amount = f"{100 * min(work.done, work.of) / work.of:.0f} %" if work.of > 0 else str(work.done)
        groups = "" if work.groups_left is None else f"  groups left {work.groups_left}"
        text = f"after {self._number:>4}  {work.activity} {amount}{groups}{left}"
        self._draw(text, text.removesuffix(left)) if self._terminal else self._line(text)

    def _interval(self) -> float:
        return 0.05 if self._terminal else 1.0

    def _is_due(self) -> bool:
        if time.monotonic() < self._shown + self._interval():
            return False
        self._shown = time.monotonic()
        return True

    def _draw(self, *lines: str) -> None:
        """Draws the first line that fits, because a number that is cut says something else."""
        width = shutil.get_terminal_size().columns - 1
        line = next((line for line in lines if len(line) <= width), lines[-1][:width])
        self._stream.write("\r\x1b[K" + line)
        self._stream.flush()
        self._open = True
