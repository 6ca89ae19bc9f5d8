"""Many cells in one process as a Gymnasium vector environment."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from .cells import OfCells, Options

if TYPE_CHECKING:
    from typing_extensions import Unpack


class _View:
    """What evaluation code asks of one environment of many."""

    def __init__(self, env: TrocarVectorEnv):
        self.task, self.task_description = env.task, env.task_description
        self._max_episode_steps = env._max_episode_steps
        self.metadata, self.spec = env.metadata, env.spec
        self.observation_space, self.action_space = env.single_observation_space, env.single_action_space

    @property
    def unwrapped(self) -> _View:
        return self


class TrocarVectorEnv(OfCells, gym.vector.VectorEnv):
    """`num_envs` episodes side by side, stepped in parallel without the interpreter's lock; see `trocar.envs` for the options.

    Observations, rewards and channels are arrays that native code writes; with `copy=False` they are handed out as they are and
    change with the next step. A cell with seed S gives the bits that `TrocarEnv` gives with it, whatever the others do.

    `autoreset_mode` is one of Gymnasium's: `next-step` (the step after an ended episode resets it and ignores its action),
    `same-step` (the step that ends an episode resets it; `info` has `final_obs` and `final_info`), `disabled`
    (`reset(options={"reset_mask": ...})` is the caller's).
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
        self.num_envs, self.copy = num_envs, copy
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = type(self).metadata | {"autoreset_mode": self.autoreset_mode}
        self._begin(num_envs, scene, render_mode, options)
        self.single_observation_space = self.cells.observation_space()
        self.single_action_space = self.cells.action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._over = np.zeros(num_envs, bool)
        self._dice = [np.random.default_rng() for _ in range(num_envs)]
        self.envs = [_View(self) for _ in range(num_envs)]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute, or what a method gives, of each environment."""
        values = (getattr(env, name) for env in self.envs)
        return tuple(value(*args, **kwargs) if callable(value) else value for value in values)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        mask = (options or {}).get("reset_mask")
        which = np.arange(self.num_envs) if mask is None else np.flatnonzero(np.asarray(mask))
        seeds = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, (int, np.integer)):
            seeds = [int(seeds) + k for k in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: has {len(seeds)} seeds; {self.num_envs} are needed")
        for k in which:
            if seeds[k] is not None:
                self._dice[k] = np.random.default_rng(seeds[k])
        drawn = np.array([self._draw(k) if seeds[k] is None else seeds[k] for k in which], np.uint64)
        self.cells.reset(which, drawn)
        self._over[which] = False
        return self._observation(), self._infos()

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        cells = self.cells
        if self.autoreset_mode == AutoresetMode.DISABLED and self._over.any():
            raise RuntimeError(f"episodes {np.flatnonzero(self._over).tolist()} have ended; reset them by a reset_mask first")
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
                seen[k] = _row(cells.observation(), k)
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

    def save_state(self, k: int) -> Any:
        """The whole state of cell `k`; it stays in the process."""
        return self.cells.save(k), self._over[k]

    def restore_state(self, k: int, state: Any) -> None:
        """Puts a state that `save_state` gave into cell `k`."""
        saved, self._over[k] = state
        self.cells.restore(k, saved)

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
    names = {"next-step": AutoresetMode.NEXT_STEP, "same-step": AutoresetMode.SAME_STEP, "disabled": AutoresetMode.DISABLED}
    if given not in names:
        raise ValueError(f"autoreset_mode: '{given}' is unknown; {', '.join(names)} are known")
    return names[given]


def _copied(value: Any) -> Any:
    return {key: _copied(part) for key, part in value.items()} if isinstance(value, dict) else value.copy()


def _row(value: Any, k: int) -> Any:
    return {key: _row(part, k) for key, part in value.items()} if isinstance(value, dict) else value[k].copy()
