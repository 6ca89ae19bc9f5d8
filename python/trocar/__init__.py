"""Trocar: a simulator for laparoscopic robot policies.

>>> import gymnasium as gym, trocar
>>> env = gym.make("trocar/AppendixResection-v0", obs="state")
>>> envs = gym.make_vec("trocar/GraspLift-v0", num_envs=16)

- `trocar.envs`: the environments and their options.
- `trocar.view`: an environment in the browser while it is stepped.
- `trocar.datasets`: demonstrations as LeRobot and robomimic files.
- `trocar.export`: recorded episodes as datasets, rendered after the fact.
- `trocar.teleop`: the instruments in the hands of a device, with force.
- `trocar.calibration`: camera calibration.
- `trocar.serve`: serves a Python policy to `trocar evaluate`.
- `trocar.campaign`: campaigns on this machine or on a Ray cluster.
"""

import gymnasium as _gymnasium

from ._native import __version__, scenes
from ._view import Viewer, view
from .envs import TrocarEnv, TrocarVectorEnv
from .policy import Policy, policies

__all__ = [
    "TASKS",
    "Policy",
    "TrocarEnv",
    "TrocarVectorEnv",
    "Viewer",
    "__version__",
    "policies",
    "scenes",
    "view",
]

#: Environment ids and their tasks.
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
            # The native episode ends itself when its time is up.
            max_episode_steps=None,
            # LeRobot reads `task_description` from the environment, and Gymnasium's wrappers hide
            # attributes. The environment itself raises when a reset is missing, and the tests run
            # Gymnasium's checker.
            order_enforce=False,
            disable_env_checker=True,
        )
