"""Writers of one folder take turns: while one saves, others wait, in this process or another.

This is by `flock`, which goes with its process, however that ends. Where Python has no `fcntl` (Windows) nothing keeps writers
apart: one folder is for one writer there.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]

#: How long another writer is waited for that saves an episode [s].
SAVING_SECONDS = 60.0


@contextlib.contextmanager
def alone(folder: Path, seconds: float = SAVING_SECONDS) -> Iterator[None]:
    """Has `folder` to itself. A `RuntimeError` if another has it for longer than `seconds`."""
    if fcntl is None:
        yield
        return
    opened, until = os.open(folder, os.O_RDONLY), time.monotonic() + seconds
    try:
        while True:
            try:
                fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as why:
                if time.monotonic() > until:
                    raise RuntimeError(
                        f"{folder} is being written by another writer; wait for it, or write into another folder"
                    ) from why
                time.sleep(0.05)
        yield
    finally:
        os.close(opened)
