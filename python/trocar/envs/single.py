"""One cell as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from typing_extensions import Unpack

from .cells import SavedState
from .options import Options, checked_seed, drawn_seed
from .properties import OneCellMixin, row_of


class TrocarEnv(OneCellMixin, gym.Env[Any, np.ndarray]):
    """One two-arm cell. See `trocar.envs` for the options.

    `info["is_success"]` says whether the task is passed. An episode ends with `terminated` when it
    is passed or cannot continue (the port deviation at which hardware stops, diverged tissue), and
    with `truncated` when its time is up. `reset(seed=S)` starts episode S: the same seed gives the
    same bits on every machine of one architecture. Without a seed, `np_random` draws one.

    Before the first `reset`, `step`, `render` and `save_state` raise `gymnasium.error.ResetNeeded`;
    after `close` they raise `gymnasium.error.ClosedEnvironmentError`. `metadata["render_fps"]` is
    the control rate of the scene.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 30}

    def __init__(
        self, scene: str = "cell-a", *, render_mode: str | None = None, **options: Unpack[Options]
    ):
        self._build(1, scene, render_mode, options)
        self.observation_space = self.cells.observation_space()
        self.action_space = self.cells.action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts the episode of `seed`, which is one of the split."""
        split = self.cells.split
        seed = None if seed is None else checked_seed(seed, split)
        super().reset(seed=seed)
        episode = seed if seed is not None else drawn_seed(self.np_random, split)
        self.cells.reset(np.array([0]), np.array([episode]))
        return self._observation(), self.cells.info(0)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Runs one control period with `action` (10,)."""
        cells = self.cells
        cells.step(np.asarray(action)[None])
        reward, terminated, truncated = cells.rewards[0], cells.terminated[0], cells.truncated[0]
        info = cells.info(0)
        return self._observation(), float(reward), bool(terminated), bool(truncated), info

    def render(self) -> Any:
        """The endoscope's picture (height, width, 3), uint8; None without a `render_mode`."""
        return None if self.render_mode is None else self.cells.render(0)

    def close(self) -> None:
        """Frees the cell. Names and spaces stay."""
        self.cells.close()

    def save_state(self) -> SavedState:
        """Returns the whole state, including the random generator of later resets.

        A restored state continues bit for bit. It is only valid in this process.
        """
        return self.cells.save(0, self.np_random, self.np_random_seed)

    def restore_state(self, state: SavedState) -> Any:
        """Restores a state of `save_state`, of this environment or one like it.

        Returns the observation. A state of another scene or task is a ValueError.
        """
        self._np_random = self.cells.restore(0, state)
        self._np_random_seed = state.rng_seed
        return self._observation()

    def _observation(self) -> Any:
        return row_of(self.cells.observation(), 0)
