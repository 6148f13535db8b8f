# SPDX-License-Identifier: Apache-2.0
"""The progress of a run, and the line that displays it."""

from __future__ import annotations

import dataclasses
import os
import sys
import time
from typing import Any, Mapping, Optional, TextIO

_INTERVAL = 0.2  # seconds between redraws of a stage
_COLUMNS, _NOTEBOOK_COLUMNS = 80, 100


@dataclasses.dataclass(frozen=True)
class Progress:
    """The progress of a run: steps done and their total; `values` holds the last logged values by
    name ("loss", "silhouette", ...; "seconds"). stage: "fitting", "training", or a
    stage before or after these; such a stage counts its own steps, 0 of 0 if their number is
    unknown, and values is empty."""

    step: int
    steps: int
    values: Mapping[str, float]
    stage: str = ""


class ProgressLine:
    """A callback that shows stage, progress, remaining time and loss of a run on one line."""

    stages = True

    def __init__(self, stream: TextIO, columns: Optional[int] = None) -> None:
        """stream: a terminal, or a stream that handles carriage returns like one and is `columns`
        wide."""
        self._stream, self._columns = stream, columns
        self._stage, self._begun, self._first, self._drawn = "", 0.0, 0, 0.0
        self._length = 0  # of the text in the line

    def __call__(self, at: Progress) -> None:
        now = time.monotonic()
        if at.stage != self._stage:
            self.finish()
            self._stage, self._begun, self._first = at.stage, now, at.step
        elif now < self._drawn + _INTERVAL and at.step != at.steps:
            return
        self._drawn = now
        self._draw(self._text(at, now - self._begun))

    def finish(self) -> None:
        """Ends the line."""
        if self._length:
            self._write("\n")
        self._stage, self._length = "", 0

    def _text(self, at: Progress, seconds: float) -> str:
        parts = [at.stage]
        if at.steps:
            parts += [f"{at.step}/{at.steps}", f"{100 * at.step // at.steps}%"]
        if self._first < at.step < at.steps:
            left = seconds / (at.step - self._first) * (at.steps - at.step)
            parts.append(f"{int(left) // 60}:{int(left) % 60:02} left")
        if "loss" in at.values:
            parts.append(f"loss {at.values['loss']:.4g}")
        return "  ".join(parts)

    def _draw(self, text: str) -> None:
        text = text[:self._width() - 1]  # the last column would begin a new line
        self._write("\r" + text.ljust(self._length))
        self._length = len(text)

    def _width(self) -> int:
        if self._columns:
            return self._columns
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _COLUMNS
        except (OSError, ValueError):
            return _COLUMNS

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # a closed stream must not end hours of work
            pass


def watched_line() -> Optional[ProgressLine]:
    """For a terminal or a notebook; None elsewhere."""
    if _in_notebook():
        return ProgressLine(sys.stdout, _NOTEBOOK_COLUMNS)
    try:
        return ProgressLine(sys.stderr) if sys.stderr.isatty() else None
    except (AttributeError, ValueError):  # there is none, or it is closed
        return None


def _in_notebook() -> bool:
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return getattr(shell, "kernel", None) is not None
