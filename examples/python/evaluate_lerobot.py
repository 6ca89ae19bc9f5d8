r"""LeRobot's own evaluation (lerobot 0.4.4) of a policy in Trocar's environments.

    pip install . lerobot==0.4.4
    python examples/python/evaluate_lerobot.py \
        --policy.path=outputs/train/act/checkpoints/last/pretrained_model
    python examples/python/evaluate_lerobot.py

The arguments are those of `lerobot-eval`; `--env.type=trocar` comes before them. The fields of
`TrocarConfig` below are the options of `--env`. Without arguments, an ACT policy with random
weights runs one short episode, which shows that everything fits together and passes nothing. A
policy trained on a dataset of `record_demonstrations.py` needs the `--env.size`, `--env.cameras`
and `--env.normalize` of the dataset.

LeRobot steps the environments of a batch one after the other, each with all cores.
`--eval.use_async_envs=true` does not work with this version, which reads the task from the
environments in its own process.
"""

import sys
from dataclasses import dataclass, field
from typing import Any

from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.scripts import lerobot_eval
from lerobot.utils.constants import ACTION, OBS_IMAGES, OBS_STATE

#: Lengths of a state and of an action.
STATE_SIZE, ACTION_SIZE = 47, 10

#: A policy with random weights (none are downloaded) over one episode of a second.
DEFAULT_ARGUMENTS = [
    "--policy.type=act",
    "--policy.device=cpu",
    "--policy.push_to_hub=false",
    "--policy.pretrained_backbone_weights=null",
    "--env.episode_s=1.0",
    "--env.size=96",
    "--eval.batch_size=1",
    "--eval.n_episodes=1",
    "--env.variation=none",
]


@EnvConfig.register_subclass("trocar")
@dataclass
class TrocarConfig(EnvConfig):
    """An environment of Trocar for LeRobot, which makes the id `trocar/` + `task`."""

    task: str | None = "GraspLift-v0"
    fps: int = 30
    scene: str = "cell-a"
    cameras: list[str] = field(default_factory=lambda: ["endoscope", "d405"])
    #: Edge of the pictures (px).
    size: int = 224
    #: Whether actions are in [-1, 1].
    normalize: bool = False
    #: Maximum duration of an episode (s), by default the scene's.
    episode_s: float | None = None
    #: What varies: none, easy, standard or hard; by default the set of the scene, or standard.
    variation: str | None = None
    #: Seen episodes, unseen ones, or both.
    split: str = "seen"

    def __post_init__(self) -> None:
        """Declares observations and actions by LeRobot's names."""
        self.features = {
            ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(ACTION_SIZE,)),
            "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(STATE_SIZE,)),
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
        """Options of the environment. LeRobot needs a dict even without pictures."""
        return {
            "scene": self.scene,
            "obs": "agent_pos+rgb" if self.cameras else "agent_pos",
            "cameras": self.cameras or None,
            "image_size": (self.size, self.size),
            "normalize": self.normalize,
            "episode_s": self.episode_s,
            "variation": self.variation,
            "split": self.split,
            "render_mode": "rgb_array",
        }


def main() -> None:
    sys.argv[1:] = ["--env.type=trocar", *(sys.argv[1:] or DEFAULT_ARGUMENTS)]
    lerobot_eval.main()


if __name__ == "__main__":
    main()
