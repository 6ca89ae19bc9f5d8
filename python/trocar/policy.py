"""The program's own controllers, callable from Python.

>>> env = gym.make("trocar/GraspLift-v0")
>>> expert = trocar.Policy("scripted")
>>> observation, info = env.reset(seed=0)
>>> expert.reset(env)
>>> observation, *_ = env.step(expert(env))

They look at the tissue, which a policy that is to be scored must not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ._native import Controller, policies

__all__ = ["Policy", "policies"]


class Policy:
    """A controller by its name: one of `trocar.policies()`. It drives one cell, which is an environment or number `k` of a vector environment.

    The actions are those of `trocar evaluate` with the same seed, to the bit. Environments with `actions="tip"` are refused.
    """

    def __init__(self, name: str = "scripted"):
        self.name = name
        self._native = Controller(name)

    def reset(self, env: Any, k: int = 0) -> None:
        """Begins anew; call it after each reset of the environment."""
        cells, k = self._place(env, k)
        self._native.begin(cells.native, k)

    def __call__(self, env: Any, k: int = 0) -> np.ndarray:
        """The next action, for `env.step`: float64 (a cell's exact targets), or -1 to 1 where the environment is normalized."""
        cells, k = self._place(env, k)
        action = self._native.act(cells.native, k)
        if cells.normalize:
            return 2.0 * (action - cells.low) / (cells.high - cells.low) - 1.0
        return action

    @staticmethod
    def _place(env: Any, k: int) -> tuple[Any, int]:
        """The cells of an environment, and which of them is its `k`th: `envs.envs[3]` has one, the fourth of `envs`."""
        cells = env.unwrapped.cells
        if cells.action_kind != "pivots":
            raise ValueError(
                f"policy: the environment has actions='{cells.action_kind}'; controllers give 'pivots'"
            )
        return cells, env.unwrapped.cell + k
