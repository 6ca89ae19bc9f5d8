"""Many cells in one process as a Gymnasium vector environment."""

from __future__ import annotations

from typing import Any, Sequence

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from typing_extensions import Unpack

from .cells import Saved
from .of_cells import OfCells, row_of
from .options import Options, mask_of, seed_of, whole
from .view import View


class TrocarVectorEnv(OfCells, gym.vector.VectorEnv):
    """`num_envs` episodes side by side, stepped in parallel without the interpreter's lock; see `trocar.envs` for the options.

    Observations, rewards and channels are arrays that native code writes; with `copy=False` they are handed out as they are and
    change with the next step. A cell with seed S gives the bits that `TrocarEnv` gives with it, whatever the others do.

    `autoreset_mode` is one of Gymnasium's: `next-step` (the step after an ended episode resets it and ignores its action),
    `same-step` (the step that ends an episode resets it; `info` has `final_obs` and `final_info`), `disabled`
    (`reset(options={"reset_mask": ...})` is the caller's). LeRobot's evaluation reads success from `final_info`, which only
    `same-step` gives.

    `envs[k]` shows cell `k` as an environment of its own, which is not stepped alone; `call`, `get_attr` and `set_attr` go to these.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 30}

    def __init__(
        self,
        num_envs: int = 1,
        scene: str = "cell-a",
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        render_mode: str | None = None,
        **options: Unpack[Options],
    ):
        self.autoreset_mode, self.copy = _mode(autoreset_mode), copy
        self._begin(num_envs, scene, render_mode, options)
        num_envs = self.num_envs = self.cells.count
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_observation_space = self.cells.observation_space()
        self.single_action_space = self.cells.action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._over = np.zeros(num_envs, bool)
        self._dice = [np.random.default_rng() for _ in range(num_envs)]
        self.envs = [View(self, k) for k in range(num_envs)]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute, or what a method gives, of each environment."""
        values = (getattr(env, name) for env in self.envs)
        return tuple(value(*args, **kwargs) if callable(value) else value for value in values)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute of each environment's view: a list or tuple has one value for each, anything else is for all."""
        values = values if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"values: has {len(values)}; {self.num_envs} are needed")
        for env, value in zip(self.envs, values):
            setattr(env, name, value)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins the episodes of the seeds (0 to 2^63 - 1; one is for the first cell, the next ones for the others) in the cells that
        `options["reset_mask"]`, flags (num_envs,), says, or in all. Nothing is reset where either is wrong."""
        which = np.flatnonzero(mask_of((options or {}).get("reset_mask"), self.num_envs))
        seeds = self._seeds(seed)
        for k in which:
            if seeds[k] is not None:
                self._dice[k] = np.random.default_rng(seeds[k])
        self.cells.reset(
            which,
            np.array([self._draw(k) if seeds[k] is None else seeds[k] for k in which], np.uint64),
        )
        self._over[which] = False
        return self._observation(), self._infos()

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed, or None, for each cell."""
        if seed is None:
            return [None] * self.num_envs
        if np.ndim(seed) == 0:
            first = seed_of(seed)
            return [seed_of(first + k) for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"seed: has {len(seed)} seeds; {self.num_envs} are needed")
        return [None if one is None else seed_of(one) for one in seed]

    def step(
        self, actions: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        cells = self.cells
        if self.autoreset_mode == AutoresetMode.DISABLED and self._over.any():
            raise RuntimeError(
                f"episodes {np.flatnonzero(self._over).tolist()} have ended; reset them by a reset_mask first"
            )
        fresh = np.flatnonzero(self._over)
        cells.step(actions, ~self._over)
        if len(fresh):
            cells.reset(fresh, np.array([self._draw(k) for k in fresh], np.uint64))
        rewards, terminated, truncated = cells.rewards.copy(), cells.terminated, cells.truncated
        self._over = terminated | truncated
        if self.autoreset_mode != AutoresetMode.SAME_STEP or not self._over.any():
            infos = self._infos()
        else:
            over = np.flatnonzero(self._over)
            final: dict[str, Any] = {}
            for k in over:
                final = self._add_info(final, cells.info(k), k)
            seen = np.full(self.num_envs, None, dtype=object)
            for k in over:
                seen[k] = row_of(cells.observation(), k)
            cells.reset(over, np.array([self._draw(k) for k in over], np.uint64))
            # What stands outside of "final_" is of the episodes that have begun.
            infos = self._infos()
            infos["final_info"], infos["_final_info"] = final, self._over.copy()
            infos["final_obs"], infos["_final_obs"] = seen, self._over.copy()
            self._over = np.zeros(self.num_envs, bool)
        return self._observation(), rewards, terminated, truncated, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The endoscope's picture of each cell with `render_mode="rgb_array"`, otherwise None."""
        if self.render_mode is None:
            return None
        return tuple(self.cells.render(k) for k in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Frees the cells; names and spaces stay."""
        if hasattr(self, "cells"):
            self.cells.close()

    def save_state(self, k: int) -> Saved:
        """The whole state of cell `k`, the seeds of its episodes to come included; it stays in the process."""
        k = whole("k", k, 0, self.num_envs - 1)
        return self.cells.save(k, self._dice[k])

    def restore_state(self, k: int, state: Saved) -> Any:
        """Puts a state that `save_state` gave, here or of `TrocarEnv`, into cell `k`; returns what is seen there. A state of
        another scene or task is a ValueError."""
        k = whole("k", k, 0, self.num_envs - 1)
        self._dice[k] = self.cells.restore(k, state)
        self._over[k] = self.cells.ended[k] >= 0
        return row_of(self.cells.observation(), k)

    def _draw(self, k: int) -> int:
        return int(self._dice[k].integers(2**31))

    def _infos(self) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for k in range(self.num_envs):
            infos = self._add_info(infos, self.cells.info(k), k)
        return infos

    def _observation(self) -> Any:
        seen = self.cells.observation()
        return _copied(seen) if self.copy else seen


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    if isinstance(given, AutoresetMode):
        return given
    names = {
        "next-step": AutoresetMode.NEXT_STEP,
        "same-step": AutoresetMode.SAME_STEP,
        "disabled": AutoresetMode.DISABLED,
    }
    # Gymnasium's own words too.
    known = names | {mode.value: mode for mode in AutoresetMode}
    if given not in known:
        raise ValueError(f"autoreset_mode: '{given}' is unknown; {', '.join(names)} are known")
    return known[given]


def _copied(value: Any) -> Any:
    return (
        {key: _copied(part) for key, part in value.items()}
        if isinstance(value, dict)
        else value.copy()
    )
