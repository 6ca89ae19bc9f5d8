"""Many cells in one process as a Gymnasium vector environment."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from typing_extensions import Unpack

from .cells import Cells, SavedState
from .options import Options, checked_int, checked_mask, checked_seed, drawn_seed
from .properties import CellsMixin, OneCellMixin, row_of


class TrocarVectorEnv(CellsMixin, gym.vector.VectorEnv[Any, np.ndarray, np.ndarray]):
    """`num_envs` cells in one process. See `trocar.envs` for the options.

    Cells are stepped in parallel, without Python's global lock. Observations, rewards and channels
    are arrays that native code writes. With `copy=False` the environment returns these arrays
    themselves, and the next step overwrites them. A cell with seed S gives the same bits as a
    `TrocarEnv` with seed S, whatever the other cells do.

    `autoreset_mode` is one of Gymnasium's:

    - `next-step`: the step after an ended episode resets it and ignores its action.
    - `same-step`: the step that ends an episode also resets it. `info` has `final_obs` and
      `final_info`, from which LeRobot's evaluation reads success.
    - `disabled`: the caller resets, by `reset(options={"reset_mask": flags})`.

    `envs[k]` shows cell `k` as an environment that cannot be stepped alone. `call`, `get_attr` and
    `set_attr` use these.
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
        self._build(num_envs, scene, render_mode, options)
        num_envs = self.num_envs = self.cells.count
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_observation_space = self.cells.observation_space()
        self.single_action_space = self.cells.action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, bool)
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self.envs = [CellView(self, k) for k in range(num_envs)]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute of each cell, or the result of a method of each cell."""
        values = (getattr(env, name) for env in self.envs)
        return tuple(value(*args, **kwargs) if callable(value) else value for value in values)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each cell."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute of each cell's view.

        A list or tuple has one value a cell; any other value is for all cells.
        """
        values = values if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"values: has length {len(values)}; it must be {self.num_envs}")
        for env, value in zip(self.envs, values):
            setattr(env, name, value)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts episodes in the cells that `options["reset_mask"]` flags (num_envs,), or in all.

        `seed`: one a cell, or one integer S for the seeds S, S + 1, ..., each one of the split;
        cells without a seed draw one. A wrong seed or mask resets nothing.
        """
        mask = checked_mask((options or {}).get("reset_mask"), self.num_envs)
        which = np.flatnonzero(mask).tolist()
        seeds = self._seeds(seed)
        for k in which:
            if seeds[k] is not None:
                self._rngs[k] = np.random.default_rng(seeds[k])
        episodes = [self._draw_seed(k) if (s := seeds[k]) is None else s for k in which]
        self.cells.reset(np.array(which), np.array(episodes, np.uint64))
        self._ended[which] = False
        return self._observation(), self._infos()

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed, or None, for each cell."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, np.ndarray):
            seed = seed.tolist()
        if not isinstance(seed, Sequence):
            first = checked_seed(seed, self.cells.split)
            return [checked_seed(first + k, self.cells.split) for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"seed: has length {len(seed)}; it must be {self.num_envs}")
        return [None if one is None else checked_seed(one, self.cells.split) for one in seed]

    def _restart(self, which: list[int]) -> None:
        """Starts the next episodes of the cells `which`."""
        seeds = [self._draw_seed(k) for k in which]
        self.cells.reset(np.array(which), np.array(seeds, np.uint64))

    def step(
        self, actions: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Runs one control period of all cells with `actions` (num_envs, 10)."""
        cells = self.cells
        ended = np.flatnonzero(self._ended).tolist()
        if ended and self.autoreset_mode == AutoresetMode.DISABLED:
            raise RuntimeError(f"episodes {ended} have ended; reset them by a reset_mask first")
        cells.step(actions, ~self._ended)
        if ended:
            self._restart(ended)
        rewards, terminated, truncated = cells.rewards.copy(), cells.terminated, cells.truncated
        self._ended = terminated | truncated
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._restart_with_final_infos()
        else:
            infos = self._infos()
        return self._observation(), rewards, terminated, truncated, infos

    def _restart_with_final_infos(self) -> dict[str, Any]:
        """Restarts ended cells. Returns the infos of the new episodes and of the ended ones."""
        ended, flags = np.flatnonzero(self._ended).tolist(), self._ended.copy()
        final_info: dict[str, Any] = {}
        final_obs = np.full(self.num_envs, None, dtype=object)
        for k in ended:
            final_info = self._add_info(final_info, self.cells.info(k), k)
            final_obs[k] = row_of(self.cells.observation(), k)
        self._restart(ended)
        infos = self._infos()
        infos |= {"final_info": final_info, "_final_info": flags}
        infos |= {"final_obs": final_obs, "_final_obs": flags.copy()}
        self._ended = np.zeros(self.num_envs, bool)
        return infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The endoscope's picture (height, width, 3) of each cell; None without a `render_mode`."""
        if self.render_mode is None:
            return None
        return tuple(self.cells.render(k) for k in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Frees the cells. Names and spaces stay."""
        if hasattr(self, "cells"):
            self.cells.close()

    def save_state(self, k: int) -> SavedState:
        """Returns the whole state of cell `k`, including the seeds of its later episodes.

        It is only valid in this process.
        """
        k = checked_int("k", k, 0, self.num_envs - 1)
        return self.cells.save(k, self._rngs[k])

    def restore_state(self, k: int, state: SavedState) -> Any:
        """Restores a state of `save_state`, of this class or of `TrocarEnv`, into cell `k`.

        Returns the observation. A state of another scene or task is a ValueError.
        """
        k = checked_int("k", k, 0, self.num_envs - 1)
        self._rngs[k] = self.cells.restore(k, state)
        self._ended[k] = self.cells.ended[k] >= 0
        return row_of(self.cells.observation(), k)

    def _draw_seed(self, k: int) -> int:
        return drawn_seed(self._rngs[k], self.cells.split)

    def _infos(self) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for k in range(self.num_envs):
            infos = self._add_info(infos, self.cells.info(k), k)
        return infos

    def _observation(self) -> Any:
        observation = self.cells.observation()
        return _copied(observation) if self.copy else observation


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    if isinstance(given, AutoresetMode):
        return given
    names = {
        "next-step": AutoresetMode.NEXT_STEP,
        "same-step": AutoresetMode.SAME_STEP,
        "disabled": AutoresetMode.DISABLED,
    }
    # Gymnasium's own names are taken too.
    known = names | {mode.value: mode for mode in AutoresetMode}
    if given not in known:
        raise ValueError(
            f"autoreset_mode: '{given}' is unknown; it must be one of {', '.join(names)}"
        )
    return known[given]


def _copied(value: Any) -> Any:
    return (
        {key: _copied(part) for key, part in value.items()}
        if isinstance(value, dict)
        else value.copy()
    )


class CellView(OneCellMixin):
    """Cell `k` of a vector environment. It is reset, stepped and closed with the other cells."""

    def __init__(self, env: TrocarVectorEnv, k: int):
        self.cell = k
        # A strong reference would be a cycle, which delays freeing the cells.
        self._parent = weakref.ref(env)

    @property
    def _env(self) -> TrocarVectorEnv:
        env = self._parent()
        if env is None:
            raise gym.error.ClosedEnvironmentError(
                "the vector environment of this cell no longer exists"
            )
        return env

    @property
    def cells(self) -> Cells:  # type: ignore[override]
        """The cells of all."""
        return self._env.cells

    @property
    def unwrapped(self) -> CellView:
        """Itself."""
        return self

    @property
    def metadata(self) -> dict[str, Any]:  # type: ignore[override]
        """Metadata of the vector environment."""
        return self._env.metadata

    @property
    def spec(self) -> Any:
        """Gymnasium's specification of the vector environment; None if it was not made by id."""
        return self._env.spec

    @property
    def render_mode(self) -> str | None:  # type: ignore[override]
        """Mode of `render`."""
        return self._env.render_mode

    @property
    def observation_space(self) -> gym.Space[Any]:
        """Space of one cell."""
        return self._env.single_observation_space

    @property
    def action_space(self) -> gym.Space[Any]:
        """Space of one cell."""
        return self._env.single_action_space

    @property
    def np_random(self) -> np.random.Generator:
        """Draws the seeds of the cell's episodes."""
        return self._env._rngs[self.cell]

    def render(self) -> np.ndarray | None:
        """The endoscope's picture (height, width, 3), uint8; None without a `render_mode`."""
        return None if self.render_mode is None else self.cells.render(self.cell)

    def save_state(self) -> SavedState:
        """As `TrocarVectorEnv.save_state` of this cell."""
        return self._env.save_state(self.cell)

    def restore_state(self, state: SavedState) -> Any:
        """As `TrocarVectorEnv.restore_state` of this cell."""
        return self._env.restore_state(self.cell, state)
