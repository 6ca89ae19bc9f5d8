"""The native cells with their arrays and spaces. One environment and many share this."""

from __future__ import annotations

import copy
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from .._native import Cells as NativeCells
from .._native import State, missing_specimens, phantoms_folder
from .._native import cameras as scene_cameras
from .options import Options, checked_int, checked_size, checked_split, kinds_of

__all__ = ["Cells", "Options", "SavedState", "phantoms_folder"]

#: Most cells of an environment, and most threads.
MAX_CELLS, MAX_THREADS = 4096, 1024
#: A camera of the recording rig, which a hospital does not have.
RECORDING_CAMERA = "recording"
#: Columns of `Cells.figures`.
REWARD, SCORE, STAGE, END, TIME = range(5)


@dataclass(frozen=True)
class SavedState:
    """The state of a cell. It is only valid in this process."""

    native: State
    #: Seed of the episode.
    seed: int
    #: Draws the seeds of later episodes.
    rng: np.random.Generator
    #: The seed of `rng`, -1 if unknown.
    rng_seed: int = -1


class Cells:
    """Native cells with the arrays that every step writes in place.

    - `state`: float32 (count, numbers), the observed state.
    - `figures`: float64 (count, 5): reward, score, stage, end, time (s).
    - `channels`: float64 (count, channels), privileged.
    - `color`: uint8 (count, height, width, 3) by camera.
    - `depth`: float32 (count, height, width, 1) by camera, z (m).
    """

    def __init__(
        self,
        count: int,
        scene: str = "cell-a",
        *,
        task: str | None = None,
        obs: str = "state",
        actions: str = "pivots",
        normalize: bool = False,
        episode_s: float | None = None,
        threads: int = 0,
        privileged: bool = False,
        cameras: Sequence[str] | None = None,
        image_size: tuple[int, int] | None = None,
        sensor_noise: bool = False,
        variation: str | None = None,
        split: str = "seen",
        backend: str | None = None,
    ):
        self.split = checked_split(split)
        self.kinds, self.in_dict = kinds_of(obs)
        count = checked_int("num_envs", count, 1, MAX_CELLS)
        threads = checked_int("threads", threads, 0, MAX_THREADS)
        self._choose_cameras(scene, cameras, checked_size(image_size))
        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        missing = missing_specimens(scene, variation, split, folder)
        if missing > 1:
            logging.getLogger("trocar").warning(
                "making %d anatomies in %s, about a minute each; later environments use them "
                "again, and variation='none' needs only one",
                missing,
                folder,
            )
        native = NativeCells(
            scene,
            count,
            phantoms=folder,
            threads=threads,
            task=task,
            actions=actions,
            episode_s=episode_s,
            sensor_noise=sensor_noise,
            variation=variation,
            split=split,
            backend=backend,
        )
        self._native: NativeCells | None = native
        self.count, self.privileged, self.normalize = count, privileged, normalize
        self.task, self.prompt, self.max_steps = native.task, native.prompt, native.max_steps
        self.state_names, self.action_names = native.state_names, native.action_names
        self.channel_names = native.channel_names
        #: Control steps a second. Scenes have whole numbers, as videos and datasets need.
        self.fps = round(native.control_hz)
        #: Cells that have been reset once.
        self.started = np.zeros(count, bool)
        self.state = np.zeros((count, len(self.state_names)), np.float32)
        self.seeds = np.zeros(count, np.uint64)
        self.figures = np.zeros((count, len(native.figure_names)), np.float64)
        # No episode has ended.
        self.figures[:, END] = -1
        self.channels = np.zeros((count, len(self.channel_names)), np.float64)
        self.written = (self.state, self.figures, self.channels)
        self.low, self.high = native.action_limits
        self.action_kind = actions
        self.color = {
            camera: np.zeros((count, *size, 3), np.uint8)
            for camera, size in self.sizes.items()
            if "rgb" in self.kinds
        }
        self.depth = {
            camera: np.zeros((count, *size, 1), np.float32)
            for camera, size in self.sizes.items()
            if "depth" in self.kinds
        }
        self.ends = native.end_names
        self.stages = native.stage_names

    @property
    def native(self) -> NativeCells:
        """The native cells. `gymnasium.error.ClosedEnvironmentError` after `close`."""
        if self._native is None:
            raise gym.error.ClosedEnvironmentError("the environment is closed; make another one")
        return self._native

    def close(self) -> None:
        """Frees the cells and the arrays of pictures."""
        self._native, self.color, self.depth = None, {}, {}

    def _check_started(self, which: np.ndarray) -> None:
        """Raises unless every cell that `which` (count,) flags has been reset once."""
        if missing := np.flatnonzero(which & ~self.started).tolist():
            raise gym.error.ResetNeeded(f"call reset first: cells {missing} have no episode")

    def action_space(self) -> gym.spaces.Box:
        """Space of one cell's actions."""
        if self.normalize:
            return gym.spaces.Box(-1.0, 1.0, self.low.shape, np.float32)
        low, high = self.low.astype(np.float32), self.high.astype(np.float32)
        return gym.spaces.Box(low, high, dtype=np.float32)

    def _choose_cameras(
        self, scene: str, wanted: Sequence[str] | None, size: tuple[int, int] | None
    ) -> None:
        """Chooses the observed cameras and their height and width (px)."""
        known = {name: (height, width) for name, height, width, _ in scene_cameras(scene)}
        if wanted is None:
            wanted = [name for name in known if name != RECORDING_CAMERA]
        wanted = [wanted] if isinstance(wanted, str) else list(wanted)
        unknown = [name for name in wanted if name not in known]
        if unknown or len(set(wanted)) != len(wanted):
            raise ValueError(f"cameras: {wanted} must be some of {', '.join(known)}, each once")
        pictures = {"rgb", "depth"} & set(self.kinds)
        if pictures and not wanted:
            raise ValueError(
                f"cameras: {' and '.join(sorted(pictures))} needs one; there are {', '.join(known)}"
            )
        self.sizes = {name: size or known[name] for name in wanted} if pictures else {}
        self.render_size = size or known.get("endoscope", (224, 224))
        self.render_camera = "endoscope" if "endoscope" in known else next(iter(known), None)

    def _render_observations(self, which: np.ndarray) -> None:
        """Writes the pictures of the cells that `which` (count,) flags."""
        if self.sizes:
            cameras, sizes = list(self.sizes), list(self.sizes.values())
            color, depth = list(self.color.values()), list(self.depth.values())
            self.native.see(cameras, sizes, which, color, depth)

    def render(self, k: int) -> np.ndarray:
        """The endoscope's picture of cell `k`: uint8 (height, width, 3)."""
        if self.render_camera is None:
            raise ValueError("render: the scene has no camera")
        native = self.native
        self._check_started(np.arange(self.count) == k)
        return native.picture(k, self.render_camera, *self.render_size)

    def observation_space(self) -> gym.Space[Any]:
        """Space of one cell's observations."""
        state = gym.spaces.Box(-np.inf, np.inf, (self.state.shape[1],), np.float32)
        if not self.in_dict:
            return state
        parts: dict[str, gym.Space[Any]] = {}
        if "state" in self.kinds:
            parts["agent_pos"] = state
        if self.color:
            pixels: dict[str, gym.Space[Any]] = {
                camera: gym.spaces.Box(0, 255, array.shape[1:], np.uint8)
                for camera, array in self.color.items()
            }
            parts["pixels"] = gym.spaces.Dict(pixels)
        if self.depth:
            depths: dict[str, gym.Space[Any]] = {
                camera: gym.spaces.Box(0.0, np.inf, array.shape[1:], np.float32)
                for camera, array in self.depth.items()
            }
            parts["depth"] = gym.spaces.Dict(depths)
        return gym.spaces.Dict(parts)

    def observation(self) -> Any:
        """The current observation of all cells: the arrays themselves, which a step overwrites."""
        if not self.in_dict:
            return self.state
        parts: dict[str, Any] = {}
        if "state" in self.kinds:
            parts["agent_pos"] = self.state
        if self.color:
            parts["pixels"] = dict(self.color)
        if self.depth:
            parts["depth"] = dict(self.depth)
        return parts

    def reset(self, which: np.ndarray, seeds: np.ndarray) -> None:
        """Starts the episodes of `seeds` (n,) in the cells `which` (n,)."""
        which, seeds = np.asarray(which, np.int64), np.asarray(seeds, np.uint64)
        self.native.reset(which, seeds, self.written)
        self.seeds[which], self.started[which] = seeds, True
        flags = np.zeros(self.count, bool)
        flags[which] = True
        self._render_observations(flags)

    def step(self, actions: np.ndarray, active: np.ndarray | None = None) -> None:
        """Steps the cells that `active` (count,) flags (default: all) by `actions` (count, n)."""
        native = self.native
        active = np.ones(self.count, bool) if active is None else np.asarray(active, bool)
        self._check_started(active)
        actions = np.asarray(actions, np.float64)
        needed = (self.count, len(self.low))
        if actions.shape != needed:
            raise ValueError(f"actions: have shape {actions.shape}; it must be {needed}")
        if self.normalize:
            share = 0.5 * (np.clip(actions, -1.0, 1.0) + 1.0)
            actions = self.low + share * (self.high - self.low)
        native.step(np.ascontiguousarray(actions), active, self.written)
        self._render_observations(active)

    def save(self, k: int, rng: np.random.Generator, rng_seed: int = -1) -> SavedState:
        """The state of cell `k`, with the generator `rng` of its later seeds."""
        native = self.native
        self._check_started(np.arange(self.count) == k)
        return SavedState(native.save(k), int(self.seeds[k]), copy.deepcopy(rng), rng_seed)

    def restore(self, k: int, saved: SavedState) -> np.random.Generator:
        """Restores cell `k` and returns a copy of the saved generator.

        A refused state changes nothing.
        """
        if not isinstance(saved, SavedState):
            kind = type(saved).__name__
            raise TypeError(f"state: is a {kind}; it must be a result of save_state")
        self.native.restore(k, saved.native, self.written)
        self.seeds[k], self.started[k] = saved.seed, True
        self._render_observations(np.arange(self.count) == k)
        return copy.deepcopy(saved.rng)

    @property
    def rewards(self) -> np.ndarray:
        """Reward of the last step of each cell (count,)."""
        return self.figures[:, REWARD]

    @property
    def ended(self) -> np.ndarray:
        """Index of the end of each cell's episode in `ends` (count,), -1 while it runs."""
        return self.figures[:, END].astype(int)

    @property
    def truncated(self) -> np.ndarray:
        """Cells whose time is up (count,)."""
        truncated: np.ndarray = self.ended == self.ends.index("time-out")
        return truncated

    @property
    def terminated(self) -> np.ndarray:
        """Cells whose episode ended for another reason (count,)."""
        terminated: np.ndarray = (self.ended >= 0) & ~self.truncated
        return terminated

    @property
    def success(self) -> np.ndarray:
        """Cells whose task is passed (count,)."""
        success: np.ndarray = self.ended == self.ends.index("passed")
        return success

    def info(self, k: int) -> dict[str, Any]:
        """The `info` of cell `k`, with what was drawn at the start of its episode.

        Once its episode has ended, its end and summary too.
        """
        figures = self.figures[k]
        info: dict[str, Any] = {
            "is_success": bool(self.success[k]),
            "stage": int(figures[STAGE]),
            "score": float(figures[SCORE]),
            "time_s": float(figures[TIME]),
            "seed": int(self.seeds[k]),
        }
        if figures[TIME] == 0.0:
            info["drawn"] = json.loads(self.native.drawn(k))
        if self.privileged:
            info["channels"] = self.channels[k].copy()
        if figures[END] >= 0:
            info |= {
                "end": self.ends[int(figures[END])],
                "why": self.native.why(k),
                "summary": json.loads(self.native.summary(k)),
            }
        return info
