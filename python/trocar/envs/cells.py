"""What one environment and many have in common: the native cells, their arrays, spaces, and words for what happened."""

from __future__ import annotations

import copy
import json
from dataclasses import dataclass
from typing import Any, Sequence

import gymnasium as gym
import numpy as np

from .._native import Cells as Native
from .._native import State, phantoms_folder
from .._native import cameras as scene_cameras
from .options import Options, kinds_of, size_of, whole


@dataclass(frozen=True)
class Saved:
    """A cell as it was, with what Python keeps of it; an object of this process."""

    native: State
    seed: int
    #: Draws the seeds of the episodes that follow, and what it was made with (-1 where that is not known).
    dice: np.random.Generator
    dice_seed: int = -1


class Cells:
    """Native cells with the arrays that they write: `state` (cells, numbers), `figures` and `channels`, in place at every step."""

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
    ):
        self.kinds, self.in_dict = kinds_of(obs)
        count, threads = whole("num_envs", count, 1, 4096), whole("threads", threads, 0, 1024)
        self._choose_cameras(scene, cameras, size_of(image_size))
        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        native = self._native = Native(
            scene,
            count,
            phantoms=folder,
            threads=threads,
            task=task,
            actions=actions,
            episode_s=episode_s,
            sensor_noise=sensor_noise,
        )
        self.count, self.privileged, self.normalize = count, privileged, normalize
        self.task, self.prompt, self.max_steps = native.task, native.prompt, native.max_steps
        self.state_names, self.action_names, self.channel_names = native.state_names, native.action_names, native.channel_names
        #: Steps a second. Scenes have whole ones, which films and datasets want.
        self.fps = round(native.control_hz)
        #: Cells whose first episode has begun.
        self.begun = np.zeros(count, bool)
        self.state = np.zeros((count, len(self.state_names)), np.float32)
        self.seeds = np.zeros(count, np.uint64)
        self.figures = np.zeros((count, len(native.figure_names)), np.float64)
        # No episode has ended, nor begun.
        self.figures[:, 3] = -1
        self.channels = np.zeros((count, len(self.channel_names)), np.float64)
        self.written = (self.state, self.figures, self.channels)
        self.low, self.high = native.action_limits
        self.action_kind = actions
        self.color = {c: np.zeros((count, *s, 3), np.uint8) for c, s in self.sizes.items() if "rgb" in self.kinds}
        self.depth = {c: np.zeros((count, *s, 1), np.float32) for c, s in self.sizes.items() if "depth" in self.kinds}
        self.ends = native.end_names
        self.stages = native.stage_names

    @property
    def native(self) -> Native:
        """The native cells, until they are closed."""
        if self._native is None:
            raise gym.error.ClosedEnvironmentError("the environment is closed; make another")
        return self._native

    def close(self) -> None:
        """Frees the cells and the arrays of pictures."""
        self._native, self.color, self.depth = None, {}, {}

    def _need_begun(self, which: np.ndarray) -> None:
        """Cells that are used are flagged by `which`; each must have been reset once."""
        if missing := np.flatnonzero(which & ~self.begun).tolist():
            raise gym.error.ResetNeeded(f"call reset first: cells {missing} have no episode")

    def action_space(self) -> gym.spaces.Box:
        if self.normalize:
            return gym.spaces.Box(-1.0, 1.0, self.low.shape, np.float32)
        return gym.spaces.Box(self.low.astype(np.float32), self.high.astype(np.float32), dtype=np.float32)

    def _choose_cameras(self, scene: str, wanted: Sequence[str] | None, size: tuple[int, int] | None) -> None:
        """The cameras that are observed, with height and width [px]; told before anything is built."""
        known = {name: (height, width) for name, height, width, _ in scene_cameras(scene)}
        if wanted is None:
            # The recording camera is a machine's, not a policy's.
            wanted = [name for name in known if name != "recording"]
        wanted = [wanted] if isinstance(wanted, str) else list(wanted)
        strange = [name for name in wanted if name not in known]
        if strange or len(set(wanted)) != len(wanted):
            raise ValueError(f"cameras: {wanted} cannot be seen; any of {', '.join(known)} can, each once")
        sizes = {name: size or known[name] for name in wanted}
        sees = {"rgb", "depth"} & set(self.kinds)
        if sees and not wanted:
            raise ValueError(f"cameras: {' and '.join(sorted(sees))} need at least one; there are {', '.join(known)}")
        self.sizes = sizes if sees else {}
        self.render_size = size or known.get("endoscope", (224, 224))
        self.render_camera = "endoscope" if "endoscope" in known else next(iter(known), None)

    def _look(self, which: np.ndarray) -> None:
        """Writes what the cameras see of the cells that `which` flags."""
        if self.sizes:
            self.native.see(
                list(self.sizes), list(self.sizes.values()), which, list(self.color.values()), list(self.depth.values())
            )

    def render(self, k: int) -> np.ndarray:
        """The endoscope's picture of cell `k` (height, width, 3)."""
        if self.render_camera is None:
            raise ValueError("render: the scene has no camera")
        native = self.native
        self._need_begun(np.arange(self.count) == k)
        return native.picture(k, self.render_camera, *self.render_size)

    def observation_space(self) -> gym.Space:
        state = gym.spaces.Box(-np.inf, np.inf, (self.state.shape[1],), np.float32)
        if not self.in_dict:
            return state
        parts: dict[str, gym.Space] = {}
        if "state" in self.kinds:
            parts["agent_pos"] = state
        if self.color:
            pixels = {c: gym.spaces.Box(0, 255, a.shape[1:], np.uint8) for c, a in self.color.items()}
            parts["pixels"] = gym.spaces.Dict(pixels)
        if self.depth:
            depths = {c: gym.spaces.Box(0.0, np.inf, a.shape[1:], np.float32) for c, a in self.depth.items()}
            parts["depth"] = gym.spaces.Dict(depths)
        return gym.spaces.Dict(parts)

    def observation(self) -> Any:
        """What is seen now: the arrays themselves, which the next step writes again."""
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
        """Begins the episodes of `seeds` in the cells `which`."""
        which, seeds = np.asarray(which, np.int64), np.asarray(seeds, np.uint64)
        self.native.reset(which, seeds, self.written)
        self.seeds[which], self.begun[which] = seeds, True
        flags = np.zeros(self.count, bool)
        flags[which] = True
        self._look(flags)

    def step(self, actions: np.ndarray, active: np.ndarray | None = None) -> None:
        """Steps the cells that are `active` (all if not given) by their rows of `actions`."""
        native = self.native
        active = np.ones(self.count, bool) if active is None else np.asarray(active, bool)
        self._need_begun(active)
        actions = np.asarray(actions, np.float64)
        if actions.shape != (self.count, len(self.low)):
            raise ValueError(f"actions have shape {actions.shape}; {(self.count, len(self.low))} is needed")
        if self.normalize:
            actions = self.low + 0.5 * (np.clip(actions, -1.0, 1.0) + 1.0) * (self.high - self.low)
        native.step(np.ascontiguousarray(actions), active, self.written)
        self._look(active)

    def save(self, k: int, dice: np.random.Generator, dice_seed: int = -1) -> Saved:
        """Cell `k` as it is, with the `dice` that draw its next seeds."""
        native = self.native
        self._need_begun(np.arange(self.count) == k)
        return Saved(native.save(k), int(self.seeds[k]), copy.deepcopy(dice), dice_seed)

    def restore(self, k: int, saved: Saved) -> np.random.Generator:
        """Puts `saved` into cell `k` and gives its dice, which are the caller's to put in place. What is refused changes nothing."""
        if not isinstance(saved, Saved):
            raise TypeError(f"state: is {type(saved).__name__}; what save_state gave is needed")
        self.native.restore(k, saved.native, self.written)
        self.seeds[k], self.begun[k] = saved.seed, True
        self._look(np.arange(self.count) == k)
        return copy.deepcopy(saved.dice)

    # What the figures say; their columns are reward, score, stage, end, time.

    @property
    def rewards(self) -> np.ndarray:
        return self.figures[:, 0]

    @property
    def ended(self) -> np.ndarray:
        """Number of the end of each cell's episode, -1 while it goes on."""
        return self.figures[:, 3].astype(int)

    @property
    def truncated(self) -> np.ndarray:
        return self.ended == self.ends.index("time-out")

    @property
    def terminated(self) -> np.ndarray:
        return (self.ended >= 0) & ~self.truncated

    @property
    def success(self) -> np.ndarray:
        return self.ended == self.ends.index("passed")

    def info(self, k: int) -> dict[str, Any]:
        """What `info` says of cell `k`; once its episode has ended, its figures too."""
        _, score, stage, end, time = self.figures[k]
        info = {
            "is_success": bool(self.success[k]),
            "stage": int(stage),
            "score": float(score),
            "time_s": float(time),
            "seed": int(self.seeds[k]),
        }
        if self.privileged:
            info["channels"] = self.channels[k].copy()
        if end >= 0:
            info |= {"end": self.ends[int(end)], "why": self.native.why(k), "summary": json.loads(self.native.summary(k))}
        return info
