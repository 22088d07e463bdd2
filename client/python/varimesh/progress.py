"""Shows the progress of a job on standard error: one changing line on a terminal, plain lines elsewhere."""
from __future__ import annotations

import math
import shutil
import sys
import time
from collections import deque
from typing import TextIO

from .reports import Event, Iteration, Work

_WIDTH = 16


class Progress:
    """Takes a job's events and shows them. If the stream is not a terminal, it prints at most one line per second,
    without control characters."""

    def __init__(self, tolerance: float = 1e-3, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._tolerance = tolerance
        self._recent: deque[tuple[float, float]] = deque(maxlen=20)  # seconds and log10 of residuals
        self._phase = ""
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
        """The seconds left if the residual continues to fall as it did lately. None if it does not fall, or if too little
        is known."""
        if len(self._recent) < 3 or self._tolerance <= 0:
            return None
        (first_time, first), (time_now, now) = self._recent[0], self._recent[-1]
        if time_now <= first_time or first - now < 0.05:
            return None
        return max(0.0, now - math.log10(self._tolerance)) * (time_now - first_time) / (first - now)

    def _show(self, now: Iteration) -> None:
        if now.phase != self._phase:  # the residual falls at another rate in each phase
            self._recent.clear()
            self._phase = now.phase
        if now.residual > 0:
            self._recent.append((now.seconds, math.log10(now.residual)))
            self._first = self._first or now.residual
        self._number = now.number
        if not self._is_due():
            return
        left = self.seconds_left()
        text = (f"{now.phase} {now.number:>4}  residual {now.residual:.2e}  min Js {now.min_scaled_jacobian:>7.4f}  "
                f"not certified {now.left_elements}  {now.seconds:.1f} s"
                + ("" if left is None else f"  about {left:.0f} s left"))  # fmt: skip
        if not self._terminal:
            self._line(text)
            return
        done = 0.0
        if now.residual <= self._tolerance:
            done = 1.0
        elif self._first > self._tolerance > 0:
            done = math.log(self._first / now.residual) / math.log(self._first / self._tolerance)
        filled = int(_WIDTH * min(1.0, max(0.0, done)))
        self._draw("[" + "#" * filled + "." * (_WIDTH - filled) + "] " + text)

    def _show_work(self, work: Work) -> None:
        # A short run shows its iterations, and nothing of what is inside them.
        if time.monotonic() < self._began + self._interval() or not self._is_due():
            return
        amount = f"{100 * min(work.done, work.of) / work.of:.0f} %" if work.of > 0 else str(work.done)
        groups = "" if work.groups_left is None else f"  groups left {work.groups_left}"
        text = f"after {self._number:>4}  {work.activity} {amount}{groups}"
        self._draw(text) if self._terminal else self._line(text)

    def _interval(self) -> float:
        return 0.05 if self._terminal else 1.0

    def _is_due(self) -> bool:
        if time.monotonic() < self._shown + self._interval():
            return False
        self._shown = time.monotonic()
        return True

    def _draw(self, line: str) -> None:
        self._stream.write("\r\x1b[K" + line[: shutil.get_terminal_size().columns - 1])
        self._stream.flush()
        self._open = True
