"""Types of the native module, which is documented in `crates/python/src`."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__version__: str

#: Arrays that steps write, (cells, numbers) each: states, figures, channels.
Arrays = tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]

def scenes() -> list[str]:
    """Names of the built-in scenes."""

def phantoms_folder() -> Path:
    """The folder of made phantoms: `$TROCAR_PHANTOMS`, or `trocar/phantoms` in the user's cache."""

def missing_specimens(
    scene: str, variation: str | None, split: str, phantoms: str | PathLike[str]
) -> int:
    """Number of anatomies that episodes of a scene draw from and that are not made yet."""

def policies() -> list[str]:
    """Names of the built-in controllers."""

def cameras(scene: str) -> list[tuple[str, int, int, bool]]:
    """A scene's cameras: name, height and width (px) for policies, whether it measures depth."""

class State:
    """A saved cell with its scene and specimen. It is only valid in this process."""

class Cells:
    """Cells of one scene, stepped in parallel, without Python's global lock, into caller's arrays.

    In another process than the one that made them (a child made by `fork`) they raise RuntimeError.
    Ctrl-C stops their construction.
    """

    def __init__(
        self,
        scene: str,
        count: int,
        *,
        phantoms: str | PathLike[str],
        threads: int = 0,
        task: str | None = None,
        actions: str = "pivots",
        episode_s: float | None = None,
        sensor_noise: bool = False,
        variation: str | None = None,
        split: str = "seen",
        backend: str | None = None,
    ) -> None: ...
    @property
    def count(self) -> int: ...
    @property
    def task(self) -> str: ...
    @property
    def prompt(self) -> str: ...
    @property
    def max_steps(self) -> int: ...
    @property
    def control_hz(self) -> float: ...
    @property
    def state_names(self) -> list[str]: ...
    @property
    def action_names(self) -> list[str]: ...
    @property
    def channel_names(self) -> list[str]: ...
    @property
    def figure_names(self) -> list[str]: ...
    @property
    def end_names(self) -> list[str]: ...
    @property
    def stage_names(self) -> list[str]: ...
    @property
    def action_limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def reset(
        self, which: NDArray[np.int64], seeds: NDArray[np.uint64], arrays: Arrays
    ) -> None: ...
    def step(
        self, actions: NDArray[np.float64], active: NDArray[np.bool_], arrays: Arrays
    ) -> None: ...
    def see(
        self,
        cameras: Sequence[str],
        size: Sequence[tuple[int, int]],
        active: NDArray[np.bool_],
        color: Sequence[NDArray[np.uint8]],
        depth: Sequence[NDArray[np.float32]],
    ) -> None:
        """Writes the pictures of active cells.

        `color`: (cells, height, width, 3) a camera. `depth`: (cells, height, width, 1), z (m).
        """
    def picture(self, k: int, camera: str, height: int, width: int) -> NDArray[np.uint8]: ...
    def why(self, k: int) -> str | None: ...
    def events(self, k: int) -> str: ...
    def drawn(self, k: int) -> str: ...
    def summary(self, k: int) -> str: ...
    def state_hash(self, k: int) -> int: ...
    def save(self, k: int) -> State: ...
    def restore(self, k: int, saved: State, arrays: Arrays) -> None:
        """ValueError, with nothing changed, for a state of another scene, task or specimen."""

class View:
    """The live view of cell `k`: told of every step, reset and restored state. Ends with `Cells`.

    ValueError for a port that is in use.
    """

    def __init__(self, cells: Cells, k: int, *, name: str, port: int = 0) -> None: ...
    @property
    def url(self) -> str: ...
    @property
    def wire(self) -> str: ...
    @property
    def page(self) -> bool: ...
    @property
    def closed(self) -> bool: ...
    def close(self) -> None: ...

class Controller:
    """A built-in controller."""

    def __init__(self, name: str) -> None: ...
    def begin(self, cells: Cells, k: int) -> None: ...
    def act(self, cells: Cells, k: int) -> NDArray[np.float64]: ...

class Campaign:
    """A campaign's plan and folder."""

    def __init__(
        self,
        scene: str,
        policies: list[str],
        episodes: int,
        seed: int,
        phantoms: str | PathLike[str],
        output: str | PathLike[str],
        *,
        split: str = "seen",
        variation: str | None = None,
        by: list[str] = ...,
        backend: str | None = None,
    ) -> None: ...
    @property
    def plan(self) -> str: ...
    def missing(self, retry_failed: bool = False) -> list[str]: ...
    def put(self, job: str, files: list[tuple[str, bytes]]) -> None: ...
    def finish(self, films: bool = True) -> str: ...

class Stop:
    """Stops workers on any thread, whatever they wait for."""

    def set(self) -> None: ...

class Worker:
    """A cell that runs one job after the other."""

    def __init__(
        self,
        scene: str,
        phantoms: str | PathLike[str],
        plan: str,
        *,
        stop: Stop | None = None,
        python: str | None = None,
        surfaces: bool = False,
    ) -> None: ...
    def start(self, jobs: list[str]) -> None:
        """Loads the policies of `jobs`. ValueError for one that cannot be loaded."""
    def run(self, job: str) -> list[tuple[str, bytes]]: ...

class Recorded:
    """A kept episode, frame by frame. ValueError for one that cannot be read or replayed."""

    def __init__(
        self,
        folder: str | PathLike[str],
        *,
        phantoms: str | PathLike[str],
        specimen: str | PathLike[str] | None = None,
        plain_light: bool = False,
    ) -> None: ...
    @property
    def header(self) -> str: ...
    @property
    def time_s(self) -> float: ...
    @property
    def score(self) -> float: ...
    @property
    def state(self) -> NDArray[np.float32]: ...
    def actions(self) -> list[tuple[str, list[float]]]: ...
    def advance(self) -> bool: ...
    def picture(self, camera: str, height: int, width: int) -> NDArray[np.uint8]: ...
