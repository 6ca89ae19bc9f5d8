"""Loads a campaign's Python policies before anything is built, to refuse those that fail."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

#: Maximum time in which a policy must load (s).
MAX_LOAD_S = 120.0


def check_python_policies(
    policies: Sequence[str], output: Path, episodes: int, *, retry_failed: bool
) -> None:
    """Loads each `python:` policy that has episodes to run, in a process of its own.

    ValueError for one that cannot be loaded. `output` is the campaign's folder, `episodes` the
    number of each policy's.
    """
    for policy in policies:
        before, equals, after = policy.partition("=")
        named = bool(equals) and not set(before) & set(":/")
        name, source = (before, after) if named else (policy, policy)
        if not source.startswith("python:"):
            continue
        # As campaign folders are named.
        folder = output / "episodes" / re.sub(r"[^A-Za-z0-9\-_.]", "-", name)
        kept = sum(1 for _ in folder.glob("*/result.json"))
        if kept < episodes or retry_failed:
            _check(source)


def _check(source: str) -> None:
    """ValueError unless the policy `source` loads."""
    python = os.environ.get("TROCAR_PYTHON") or sys.executable or "python3"
    command = [python, "-m", "trocar.serve", source.removeprefix("python:"), "--check"]
    try:
        # Its input closes when this process ends, and then it ends too. In a session of its own it
        # gets no Ctrl-C, which would look like a policy that fails.
        process = subprocess.Popen(
            [*command, "--until-eof"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as why:
        raise ValueError(f"{source}: {python} cannot be started: {why}") from why
    timer = threading.Timer(MAX_LOAD_S, process.kill)
    timer.daemon = True
    timer.start()
    try:
        assert process.stderr is not None
        lines = process.stderr.read().strip().splitlines()
        status = process.wait()
    finally:
        timed_out = not timer.is_alive()
        timer.cancel()
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stderr):
            if stream is not None:
                stream.close()
    if status != 0:
        reason = lines[-1].removeprefix("error: ") if lines else f"it ended with status {status}"
        if timed_out:
            reason = f"it took longer than {MAX_LOAD_S:.0f} s"
        raise ValueError(f"{source}: cannot be loaded: {reason}")
