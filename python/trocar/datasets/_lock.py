"""A lock on a folder: while one writer saves, others wait, in this process or another.

It uses `flock`, which ends with its process. Where Python has no `fcntl` (Windows) there is no
lock, and a folder must have one writer only.
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

#: Maximum time to wait for another writer that saves an episode (s).
MAX_WAIT_S = 60.0


@contextlib.contextmanager
def locked(folder: Path, max_wait_s: float = MAX_WAIT_S) -> Iterator[None]:
    """Locks `folder`. RuntimeError if another writer holds it for longer than `max_wait_s`."""
    if fcntl is None:
        yield
        return
    descriptor, deadline = os.open(folder, os.O_RDONLY), time.monotonic() + max_wait_s
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as why:
                if time.monotonic() > deadline:
                    raise RuntimeError(
                        f"{folder} is in use by another writer; "
                        "wait for it, or choose another folder"
                    ) from why
                time.sleep(0.05)
        yield
    finally:
        os.close(descriptor)
