"""Demonstrations on disk, in the layouts that imitation-learning code reads.

`LeRobotWriter` writes LeRobot datasets (v3.0 and v2.1, videos included), `RobomimicWriter` HDF5 files as robomimic's. Both take
one frame after the other and keep every finished episode whatever happens to the process. `Recorder` is a Gymnasium wrapper that
feeds any of them from an environment.

They need the optional packages of `pip install .[datasets]`.
"""

from .lerobot import LeRobotWriter
from .recorder import Recorder, features_of, robomimic_environment, robomimic_observations
from .robomimic import RobomimicWriter

__all__ = [
    "LeRobotWriter",
    "Recorder",
    "RobomimicWriter",
    "features_of",
    "robomimic_environment",
    "robomimic_observations",
]
