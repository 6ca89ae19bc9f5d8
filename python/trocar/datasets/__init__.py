"""Demonstrations on disk, in the layouts of imitation learning.

- `LeRobotWriter` writes LeRobot datasets (v3.0 and v2.1), videos included.
- `RobomimicWriter` writes HDF5 files as robomimic does.
- `Recorder` is a Gymnasium wrapper that feeds either of them from an environment.

Both writers take one frame after the other. A finished episode is safe whatever happens to the
process. They need `pip install '.[datasets]'`.
"""

try:
    from .lerobot import LeRobotWriter
    from .recorder import Recorder, features_of, robomimic_environment, robomimic_observations
    from .robomimic import RobomimicWriter
except ModuleNotFoundError as why:
    if why.name is not None and why.name.startswith("trocar"):
        raise
    MISSING = f"trocar.datasets needs the extra 'datasets' ({why}); run pip install '.[datasets]'"
    raise ModuleNotFoundError(MISSING, name=why.name) from why

__all__ = [
    "LeRobotWriter",
    "Recorder",
    "RobomimicWriter",
    "features_of",
    "robomimic_environment",
    "robomimic_observations",
]
