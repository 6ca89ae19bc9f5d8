"""The live view of an environment that a program of yours steps."""

from __future__ import annotations

import warnings
import webbrowser
from typing import Any

from ._native import View as NativeView
from .envs.cells import Cells
from .envs.options import checked_int

#: What has to be done for a page that this build lacks.
_NO_PAGE = (
    "this build of trocar has no page of the live view: with Node 20.19 or newer and npm, install "
    "trocar again (pip install .), or in a clone run npm ci && npm run build in viewer"
)


class Viewer:
    """A running live view. Close it, or use it in `with`; it also ends with its environment."""

    def __init__(self, native: NativeView):
        self._native = native
        #: Address of the page. It has a token: whoever has it may watch.
        self.url = native.url
        #: Address of the wire, for other clients (docs/guides/view-wire.md).
        self.wire = native.wire

    @property
    def closed(self) -> bool:
        """Whether it has ended."""
        return self._native.closed

    def close(self) -> None:
        """Ends the view. The environment goes on."""
        self._native.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Viewer({'closed' if self.closed else self.url})"


def view(env: Any, cell: int | None = None, *, port: int = 0, browser: bool = False) -> Viewer:
    """Shows an environment in the browser while you step it.

    `env` is a `TrocarEnv`, a `TrocarVectorEnv`, or a wrapper of one. `cell` is the index of the
    cell among many (default: the first). Your loop is the clock: each step, reset and restored
    state is shown, and nothing that a browser does reaches the environment or holds it up. Its
    bits are those without a view. With `browser` the page is opened.

    The page is served by this process on `port` of this machine (0: a free one), to those who
    have the token in its address.
    """
    inner = getattr(env, "unwrapped", env)
    cells = getattr(inner, "cells", None)
    if not isinstance(cells, Cells):
        raise TypeError(f"env: is a {type(inner).__name__}; it must be an environment of trocar")
    own = getattr(inner, "cell", 0)
    cell = own if cell is None else checked_int("cell", cell, 0, cells.count - 1)
    port = checked_int("port", port, 0, 65535)
    name = f"{cells.task}, cell {cell} of {cells.count}" if cells.count > 1 else cells.task
    viewer = Viewer(NativeView(cells.native, cell, name=name, port=port))
    if not viewer._native.page:
        warnings.warn(_NO_PAGE, RuntimeWarning, stacklevel=2)
    elif browser:
        webbrowser.open(viewer.url)
    return viewer
