"""One cell of a vector environment, for `envs.envs[k]`, `call`, `get_attr` and `set_attr`."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from .cells import Cells, SavedState
from .properties import OneCellMixin

if TYPE_CHECKING:
    from .vector import TrocarVectorEnv


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
