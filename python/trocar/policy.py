"""The built-in controllers, callable from Python.

>>> env = gym.make("trocar/GraspLift-v0")
>>> expert = trocar.Policy("scripted")
>>> observation, info = env.reset(seed=0)
>>> expert.reset(env)
>>> observation, *_ = env.step(expert(env))

They read the true state of the tissue. A policy that is scored must not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ._native import Controller, policies
from .envs.cells import Cells

__all__ = ["Policy", "policies"]


class Policy:
    """A built-in controller by name, one of `trocar.policies()`.

    It drives one cell: an environment, or cell `k` of a vector environment. With the same seed its
    actions equal those of `trocar evaluate` bit for bit. It needs an environment with
    `actions="pivots"`.
    """

    def __init__(self, name: str = "scripted"):
        self.name = name
        self._native = Controller(name)

    def reset(self, env: Any, k: int = 0) -> None:
        """Starts an episode. Call it after each reset of the environment."""
        cells, k = self._cell(env, k)
        self._native.begin(cells.native, k)

    def __call__(self, env: Any, k: int = 0) -> np.ndarray:
        """Returns the next action (10,) for `env.step`.

        float64 absolute targets (`trocar.envs`), or numbers in [-1, 1] where the environment is
        normalized.
        """
        cells, k = self._cell(env, k)
        action = self._native.act(cells.native, k)
        if cells.normalize:
            action = 2.0 * (action - cells.low) / (cells.high - cells.low) - 1.0
        return action

    @staticmethod
    def _cell(env: Any, k: int) -> tuple[Cells, int]:
        """The native cells of an environment and the index of its cell `k` among them.

        `envs.envs[3]` has one cell, which is the fourth of `envs`.
        """
        cells = env.unwrapped.cells
        if cells.action_kind != "pivots":
            raise ValueError(
                f"policy: the environment has actions='{cells.action_kind}'; "
                "built-in controllers need actions='pivots'"
            )
        return cells, env.unwrapped.cell + k
