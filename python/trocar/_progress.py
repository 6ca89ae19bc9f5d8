"""How far a campaign is and how long it still takes, for people."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Callable, TextIO

#: How often a log gets a line [s].
EVERY_S = 30.0
#: Characters of the bar.
WIDTH = 24
#: Back to the line's beginning, and away with what stood there.
CLEAR = "\r\x1b[K"


class Bar:
    """`episodes [====>   ] 3/12  0:40, about 2:01 left`: on a terminal one line that is written anew, elsewhere a line now and then.

    What is left is guessed by the mean time of what is done. `now` gives the time [s].
    """

    def __init__(self, out: TextIO | None = None, now: Callable[[], float] = time.monotonic):
        self._out = out if out is not None else sys.stderr
        self._now = now
        self._begun = now()
        self._told: float | None = None
        self._open = False

    def __call__(self, done: int, total: int) -> None:
        """Tells that `done` of `total` episodes are over."""
        if done == 0:
            self._begun = self._now()
        spent = self._now() - self._begun
        if self._out.isatty():
            # A line that wraps cannot be taken back.
            self._write(
                CLEAR + _line(done, total, spent)[: shutil.get_terminal_size().columns - 1], ""
            )
            self._open = True
        elif done in (0, total) or self._told is None or self._now() - self._told >= EVERY_S:
            self._write(_line(done, total, spent), "\n")
            self._told = self._now()

    def say(self, words: str) -> None:
        """Writes a line of its own, in the place of the bar."""
        self.close()
        self._write(words, "\n")

    def close(self) -> None:
        """Takes the bar away, so that something else can be written."""
        if self._open:
            self._write(CLEAR, "")
            self._open = False

    def _write(self, words: str, end: str) -> None:
        print(words, end=end, file=self._out, flush=True)


def _line(done: int, total: int, spent: float) -> str:
    full = WIDTH * done // max(total, 1)
    bar = "=" * full + (">" if 0 < done < total else "")
    left = f", about {_clock(spent * (total - done) / done)} left" if 0 < done < total else ""
    return f"episodes [{bar[:WIDTH]:{WIDTH}}] {done}/{total}  {_clock(spent)}{left}"


def _clock(seconds: float) -> str:
    """`1:05` or `2:03:04`."""
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{s:02}" if hours else f"{minutes}:{s:02}"
