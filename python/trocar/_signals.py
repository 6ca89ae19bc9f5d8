"""What is done after a Ctrl-C is done once, and to its end."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import Iterator


@contextmanager
def deaf() -> Iterator[None]:
    """Ctrl-C is not listened to within it: for the moments in which one is being obeyed."""
    # Only the main thread gets signals, and only it may say what becomes of them.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        # None is a handler that was not set from Python, and cannot be set again from there.
        signal.signal(signal.SIGINT, before if before is not None else signal.default_int_handler)
