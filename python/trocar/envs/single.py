"""One cell as a Gymnasium environment."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from .cells import OfCells, Options

if TYPE_CHECKING:
    from typing_extensions import Unpack


class TrocarEnv(OfCells, gym.Env):
    """One episode after the other in one two-arm cell; see `trocar.envs` for the options.

    `info["is_success"]` says whether the task is passed. An episode ends with `terminated` when it is passed or cannot go on (the
    deviation at which hardware stops, tissue that diverged) and with `truncated` when its time is up. `reset(seed=S)` begins episode
    S: the same seed gives the same bits on every machine of its kind. Without a seed the next one is drawn from `np_random`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}

    def __init__(self, scene: str = "cell-a", *, render_mode: str | None = None, **options: Unpack[Options]):
        self._begin(1, scene, render_mode, options)
        self.observation_space = self.cells.observation_space()
        self.action_space = self.cells.action_space()

    @property
    def privileged_channels(self) -> dict[str, float]:
        """Channels of the last step by name: tissue and all, for rewards of one's own and for scripts, not for policies."""
        return dict(zip(self.channel_names, self.cells.channels[0].tolist()))

    @property
    def state_hash(self) -> int:
        """Hash over every bit that the future depends on."""
        return self.cells.native.state_hash(0)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        episode = seed if seed is not None else int(self.np_random.integers(2**31))
        self.cells.reset(np.array([0]), np.array([episode]))
        return self._observation(), self.cells.info(0)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.cells.step(np.asarray(action)[None])
        reward, ended, late = self.cells.rewards[0], self.cells.terminated[0], self.cells.truncated[0]
        return self._observation(), float(reward), bool(ended), bool(late), self.cells.info(0)

    def render(self) -> np.ndarray | None:
        """The endoscope's picture (height, width, 3) with `render_mode="rgb_array"`, otherwise None."""
        return None if self.render_mode is None else self.cells.render(0)

    def save_state(self) -> Any:
        """The whole state. What follows from a restored one is the same to the bit; it stays in the process."""
        return self.cells.save(0)

    def restore_state(self, state: Any) -> Any:
        """Goes back to a state that `save_state` of this environment, or of one like it, gave; returns what is seen there."""
        self.cells.restore(0, state)
        return self._observation()

    def _observation(self) -> Any:
        return _first(self.cells.observation())


def _first(value: Any) -> Any:
    """What cell 0 sees, as a copy: users keep observations."""
    if isinstance(value, dict):
        return {key: _first(part) for key, part in value.items()}
    return value[0].copy()
