"""Trocar: a simulator for laparoscopic robot policies.

>>> import gymnasium as gym, trocar
>>> env = gym.make("trocar/AppendixResection-v0", obs="state")
>>> envs = gym.make_vec("trocar/GraspLift-v0", num_envs=16)

Environments are documented in `trocar.envs`, demonstrations on disk in `trocar.datasets`, camera calibration in `trocar.calibration`,
policies served to `trocar evaluate` in `trocar.serve`, campaigns over many machines in `trocar.campaign`.
"""

import gymnasium as _gymnasium

from ._native import __version__, scenes
from .envs import TrocarEnv, TrocarVectorEnv
from .policy import Policy, policies

__all__ = ["TASKS", "Policy", "TrocarEnv", "TrocarVectorEnv", "__version__", "policies", "scenes"]

#: Environments by name, with the task that each asks for.
TASKS = {
    "trocar/AppendixResection-v0": "appendix-resection",
    "trocar/GraspLift-v0": "grasp-lift",
    "trocar/PortReach-v0": "port-reach",
}

for _name, _task in TASKS.items():
    if _name not in _gymnasium.registry:
        _gymnasium.register(
            id=_name,
            entry_point="trocar.envs:TrocarEnv",
            vector_entry_point="trocar.envs:TrocarVectorEnv",
            kwargs={"task": _task},
            # The episode's time is the task's and ends it from within.
            max_episode_steps=None,
            # Wrappers hand no attributes on, so `gym.make` gives the environment itself: LeRobot asks it for `task_description`. It
            # says itself that a reset is missing, and the tests check what the checker would.
            order_enforce=False,
            disable_env_checker=True,
        )
