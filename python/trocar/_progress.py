"""Progress of a campaign, with the remaining time, on a terminal or in a log."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from typing import TextIO

#: Interval between lines of a log (s).
LOG_INTERVAL_S = 30.0
#: Width of the bar (characters).
WIDTH = 24
#: Returns to the start of the line and clears it.
CLEAR = "\r\x1b[K"


class Bar:
    """A progress bar: `episodes [====>   ] 3/12  0:40, about 2:01 left`.

    A terminal gets one line that is rewritten. Anything else gets a line every `LOG_INTERVAL_S`.
    The remaining time is estimated from the mean time of finished episodes. `now` returns the time
    (s).
    """

    def __init__(self, out: TextIO | None = None, now: Callable[[], float] = time.monotonic):
        self._out = out if out is not None else sys.stderr
        self._now = now
        self._start = now()
        self._last_line: float | None = None
        self._open = False

    def __call__(self, done: int, total: int) -> None:
        """Shows that `done` of `total` episodes are finished."""
        if done == 0:
            self._start = self._now()
        spent = self._now() - self._start
        if self._out.isatty():
            # A wrapped line cannot be cleared.
            self._write(
                CLEAR + _line(done, total, spent)[: shutil.get_terminal_size().columns - 1], ""
            )
            self._open = True
        elif (
            done in (0, total)
            or self._last_line is None
            or self._now() - self._last_line >= LOG_INTERVAL_S
        ):
            self._write(_line(done, total, spent), "\n")
            self._last_line = self._now()

    def print(self, text: str) -> None:
        """Replaces the bar by a line of text."""
        self.close()
        self._write(text, "\n")

    def close(self) -> None:
        """Clears the bar."""
        if self._open:
            self._write(CLEAR, "")
            self._open = False

    def _write(self, text: str, end: str) -> None:
        print(text, end=end, file=self._out, flush=True)


def _line(done: int, total: int, spent: float) -> str:
    full = WIDTH * done // max(total, 1)
    bar = "=" * full + (">" if 0 < done < total else "")
    left = f", about {_clock(spent * (total - done) / done)} left" if 0 < done < total else ""
    return f"episodes [{bar[:WIDTH]:{WIDTH}}] {done}/{total}  {_clock(spent)}{left}"


def _clock(seconds: float) -> str:
    """A duration as `1:05` or `2:03:04`."""
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{s:02}" if hours else f"{minutes}:{s:02}"
