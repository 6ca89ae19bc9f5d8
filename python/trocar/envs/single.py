"""One cell as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from typing_extensions import Unpack

from .cells import Saved
from .of_cells import OfOneCell, row_of
from .options import Options, seed_of


class TrocarEnv(OfOneCell, gym.Env):
    """One episode after the other in one two-arm cell; see `trocar.envs` for the options.

    `info["is_success"]` says whether the task is passed. An episode ends with `terminated` when it is passed or cannot go on (the
    deviation at which hardware stops, tissue that diverged) and with `truncated` when its time is up. `reset(seed=S)` begins episode
    S: the same seed gives the same bits on every machine of its kind. Without a seed the next one is drawn from `np_random`.

    `step`, `render` and `save_state` before the first `reset` raise `gymnasium.error.ResetNeeded`, after `close`
    `gymnasium.error.ClosedEnvironmentError`. `metadata["render_fps"]` is the rate of the scene.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 30}

    def __init__(
        self, scene: str = "cell-a", *, render_mode: str | None = None, **options: Unpack[Options]
    ):
        self._begin(1, scene, render_mode, options)
        self.observation_space = self.cells.observation_space()
        self.action_space = self.cells.action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins the episode of `seed` (0 to 2^63 - 1)."""
        seed = None if seed is None else seed_of(seed)
        super().reset(seed=seed)
        episode = seed if seed is not None else int(self.np_random.integers(2**31))
        self.cells.reset(np.array([0]), np.array([episode]))
        return self._observation(), self.cells.info(0)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.cells.step(np.asarray(action)[None])
        reward, ended, late = (
            self.cells.rewards[0],
            self.cells.terminated[0],
            self.cells.truncated[0],
        )
        return self._observation(), float(reward), bool(ended), bool(late), self.cells.info(0)

    def render(self) -> np.ndarray | None:
        """The endoscope's picture (height, width, 3) with `render_mode="rgb_array"`, otherwise None."""
        return None if self.render_mode is None else self.cells.render(0)

    def close(self) -> None:
        """Frees the cell; names and spaces stay."""
        self.cells.close()

    def save_state(self) -> Saved:
        """The whole state, the random numbers of the resets to come included. What follows from a restored one is the same to the
        bit; it stays in the process."""
        return self.cells.save(0, self.np_random, self.np_random_seed)

    def restore_state(self, state: Saved) -> Any:
        """Goes back to a state that `save_state` of this environment, or of one like it, gave; returns what is seen there. A state of
        another scene or task is a ValueError."""
        self._np_random = self.cells.restore(0, state)
        self._np_random_seed = state.dice_seed
        return self._observation()

    def _observation(self) -> Any:
        return row_of(self.cells.observation(), 0)
