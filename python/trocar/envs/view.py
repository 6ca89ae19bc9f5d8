"""One cell of a vector environment, for code that asks `envs.envs[k]`, `call`, `get_attr` and `set_attr`."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from .cells import Cells, Saved
from .of_cells import OfOneCell

if TYPE_CHECKING:
    from .vector import TrocarVectorEnv


class View(OfOneCell):
    """Cell `k` of a vector environment. It is reset, stepped and closed with the others, and lives as long as they do."""

    def __init__(self, env: TrocarVectorEnv, k: int):
        self.cell = k
        # A strong reference would keep the cells until the garbage collector finds the circle.
        self._all = weakref.ref(env)

    @property
    def _env(self) -> TrocarVectorEnv:
        env = self._all()
        if env is None:
            raise gym.error.ClosedEnvironmentError("the vector environment of this cell is gone")
        return env

    @property
    def cells(self) -> Cells:  # type: ignore[override]
        """The cells of all."""
        return self._env.cells

    @property
    def unwrapped(self) -> View:
        """Itself."""
        return self

    @property
    def metadata(self) -> dict[str, Any]:  # type: ignore[override]
        """Metadata of the vector environment."""
        return self._env.metadata

    @property
    def spec(self) -> Any:
        """What the vector environment was made by, if it was made by name."""
        return self._env.spec

    @property
    def render_mode(self) -> str | None:  # type: ignore[override]
        """How pictures are shown."""
        return self._env.render_mode

    @property
    def observation_space(self) -> gym.Space:
        """Space of one cell."""
        return self._env.single_observation_space

    @property
    def action_space(self) -> gym.Space:
        """Space of one cell."""
        return self._env.single_action_space

    @property
    def np_random(self) -> np.random.Generator:
        """Draws the seeds of the cell's episodes."""
        return self._env._dice[self.cell]

    def render(self) -> np.ndarray | None:
        """The endoscope's picture (height, width, 3) with `render_mode="rgb_array"`, otherwise None."""
        return None if self.render_mode is None else self.cells.render(self.cell)

    def save_state(self) -> Saved:
        """As the vector environment's, of this cell."""
        return self._env.save_state(self.cell)

    def restore_state(self, state: Saved) -> Any:
        """As the vector environment's, of this cell."""
        return self._env.restore_state(self.cell, state)
