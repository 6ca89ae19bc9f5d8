"""What one environment and many have in common: the native cells, their arrays, spaces, and words for what happened."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from .._native import Cells as Native

#: What can be observed.
KINDS = ("state", "rgb", "depth")

#: What the task asks for, in words for policies that read.
DESCRIPTIONS = {
    "appendix-resection": "grasp the {organ} with the left instrument, lift it, and close the right instrument's blades through it",
    "grasp-lift": "grasp the {organ} with the left instrument, lift it and hold it",
    "port-reach": "move both instruments through their ports to one place after the other",
}


def phantoms_folder() -> Path:
    """Where phantoms are kept once they are made: `$TROCAR_PHANTOMS`, or `trocar/phantoms` in the user's cache."""
    if given := os.environ.get("TROCAR_PHANTOMS"):
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "trocar" / "phantoms"


class Cells:
    """Native cells with the arrays that they write: `state` (cells, numbers), `figures` and `channels`, in place at every step."""

    def __init__(
        self,
        count: int,
        *,
        scene: str,
        task: str | None,
        obs: str,
        actions: str,
        normalize: bool,
        episode_s: float | None,
        threads: int,
        privileged: bool,
    ):
        self.kinds = obs.split("+")
        unknown = [kind for kind in self.kinds if kind not in KINDS]
        if unknown or len(set(self.kinds)) != len(self.kinds):
            raise ValueError(f"obs: '{obs}' cannot be observed; join any of {', '.join(KINDS)} by '+'")
        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        self.native = Native(
            scene, count, phantoms=folder, threads=threads, task=task, actions=actions, episode_s=episode_s
        )
        self.count, self.privileged, self.normalize = count, privileged, normalize
        native = self.native
        self.state = np.zeros((count, len(native.state_names)), np.float32)
        self.figures = np.zeros((count, len(native.figure_names)), np.float64)
        self.channels = np.zeros((count, len(native.channel_names)), np.float64)
        self.low, self.high = native.action_limits
        self.ends = native.end_names
        self.stages = native.stage_names
        self.task_description = DESCRIPTIONS[native.task].format(organ=native.organ)

    def action_space(self) -> gym.spaces.Box:
        if self.normalize:
            return gym.spaces.Box(-1.0, 1.0, self.low.shape, np.float32)
        return gym.spaces.Box(self.low.astype(np.float32), self.high.astype(np.float32), dtype=np.float32)

    def observation_space(self) -> gym.Space:
        return gym.spaces.Box(-np.inf, np.inf, (self.state.shape[1],), np.float32)

    def observation(self) -> Any:
        """What is seen now: the arrays themselves, which the next step writes again."""
        return self.state

    def reset(self, which: np.ndarray, seeds: np.ndarray) -> None:
        """Begins the episodes of `seeds` in the cells `which`."""
        which, seeds = np.asarray(which, np.int64), np.asarray(seeds, np.uint64)
        self.native.reset(which, seeds, self.state, self.figures, self.channels)

    def step(self, actions: np.ndarray, active: np.ndarray | None = None) -> None:
        """Steps the cells that are `active` (all if not given) by their rows of `actions`."""
        actions = np.asarray(actions, np.float64)
        if actions.shape != (self.count, len(self.low)):
            raise ValueError(f"actions have shape {actions.shape}; {(self.count, len(self.low))} is needed")
        if self.normalize:
            actions = self.low + 0.5 * (np.clip(actions, -1.0, 1.0) + 1.0) * (self.high - self.low)
        active = np.ones(self.count, bool) if active is None else np.asarray(active, bool)
        self.native.step(np.ascontiguousarray(actions), active, self.state, self.figures, self.channels)

    def save(self, k: int) -> Any:
        """The state of cell `k`: an object of this process."""
        return self.native.save(k)

    def restore(self, k: int, state: Any) -> None:
        self.native.restore(k, state, self.state, self.figures, self.channels)

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
        }
        if self.privileged:
            info["channels"] = self.channels[k].copy()
        if end >= 0:
            info |= {"end": self.ends[int(end)], "why": self.native.why(k), "summary": json.loads(self.native.summary(k))}
        return info
