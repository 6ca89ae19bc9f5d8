"""LeRobot's own evaluation (lerobot 0.4.4) of a policy in Trocar's environments.

    pip install . lerobot==0.4.4
    python examples/python/evaluate_lerobot.py --policy.path=outputs/train/act/checkpoints/last/pretrained_model
    python examples/python/evaluate_lerobot.py

The arguments are those of `lerobot-eval`; `--env.type=trocar` with the options below stands before them. Without any, a freshly made
ACT with random weights is evaluated over one short episode, which shows that all fits together and passes nothing. A policy trained
on what `record_demonstrations.py` records fits if `--env.size`, `--env.cameras` and `--env.normalize` are as they were there.

LeRobot steps the environments of a batch one after the other, each with all cores. `--eval.use_async_envs=true` is not for this
version of it, which asks the environments for their task in this process.
"""

import sys
from dataclasses import dataclass, field
from typing import Any

from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.scripts import lerobot_eval
from lerobot.utils.constants import ACTION, OBS_IMAGES, OBS_STATE

#: Numbers of a state and of an action.
STATE, TARGETS = 47, 10

#: A policy of random weights (and none fetched), over one episode of a second.
FRESH = [
    "--policy.type=act",
    "--policy.device=cpu",
    "--policy.push_to_hub=false",
    "--policy.pretrained_backbone_weights=null",
    "--env.episode_s=1.0",
    "--env.size=96",
    "--eval.batch_size=1",
    "--eval.n_episodes=1",
]


@EnvConfig.register_subclass("trocar")
@dataclass
class TrocarConfig(EnvConfig):
    """An environment of Trocar, for LeRobot: `trocar/` and `task` are what `gymnasium.make` is asked for."""

    task: str | None = "GraspLift-v0"
    fps: int = 30
    scene: str = "cell-a"
    cameras: list[str] = field(default_factory=lambda: ["endoscope", "d405"])
    #: Side of the pictures [px].
    size: int = 224
    #: Actions are -1 to 1.
    normalize: bool = False
    #: Longest episode [s]; the scene's if not given.
    episode_s: float | None = None

    def __post_init__(self) -> None:
        """What the policy sees and does, and what LeRobot calls it."""
        self.features = {
            ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(TARGETS,)),
            "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(STATE,)),
        }
        self.features_map = {ACTION: ACTION, "agent_pos": OBS_STATE}
        for camera in self.cameras:
            self.features[f"pixels/{camera}"] = PolicyFeature(
                type=FeatureType.VISUAL, shape=(self.size, self.size, 3)
            )
            self.features_map[f"pixels/{camera}"] = f"{OBS_IMAGES}.{camera}"

    @property
    def package_name(self) -> str:
        """The package that registers the environments."""
        return "trocar"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Options of the environment; a state without pictures is in a dict too, which LeRobot wants."""
        return {
            "scene": self.scene,
            "obs": "agent_pos+rgb" if self.cameras else "agent_pos",
            "cameras": self.cameras or None,
            "image_size": (self.size, self.size),
            "normalize": self.normalize,
            "episode_s": self.episode_s,
            "render_mode": "rgb_array",
        }


def main() -> None:
    sys.argv[1:] = ["--env.type=trocar", *(sys.argv[1:] or FRESH)]
    lerobot_eval.main()


if __name__ == "__main__":
    main()
