"""Blocks Ctrl-C while an earlier one is handled."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ignore_interrupts() -> Iterator[None]:
    """Ignores Ctrl-C inside the context."""
    # Only the main thread receives signals and may set their handlers.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        # None is a handler that Python did not set and cannot set again.
        signal.signal(signal.SIGINT, before if before is not None else signal.default_int_handler)
