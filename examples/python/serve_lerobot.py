"""Serves a policy that LeRobot trained (lerobot 0.4.4), for `trocar evaluate`.

    pip install '.[policies]' lerobot==0.4.4
    lerobot-train --dataset.repo_id=local/lifts --dataset.root=lifts --policy.type=act \
        --policy.device=cpu --policy.push_to_hub=false --output_dir=act
    python examples/python/serve_lerobot.py act/checkpoints/last/pretrained_model --port 8000
    trocar evaluate examples/python/lift_from_pictures.toml --split unseen \
        --policy act=ws://127.0.0.1:8000

The dataset is one of `record_demonstrations.py`. The pictures of the scene must have the size of
those of the dataset. ACT begins from downloaded weights; without them
(`--policy.pretrained_backbone_weights=null`) it hardly learned until `--policy.pre_norm=true` was
added (docs/measurements/learning.md).
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.constants import OBS_IMAGES, OBS_STATE

from trocar.serve import Served, serve

#: Most actions of a chunk that `trocar evaluate` executes.
EXECUTED = 8


class LeRobotPolicy:
    """A policy of LeRobot with its normalization, on the CPU."""

    def __init__(self, folder: Path):
        config = PreTrainedConfig.from_pretrained(folder)
        config.device = "cpu"
        # A policy that asks for a new observation sooner gets it.
        self.count = min(EXECUTED, config.n_action_steps)
        self.policy = get_policy_class(config.type).from_pretrained(folder, config=config)
        self.before, self.after = make_pre_post_processors(
            config,
            str(folder),
            preprocessor_overrides={"device_processor": {"device": "cpu"}},
        )

    def reset(self) -> None:
        """Starts an episode."""
        self.policy.reset()

    def infer(self, obs: dict[str, Any]) -> dict[str, Any]:
        """A chunk (steps, 10) of absolute targets."""
        seen: dict[str, Any] = {
            OBS_STATE: torch.from_numpy(np.array(obs["observation/state"], np.float32))
        }
        for name, picture in obs.items():
            camera = name.removeprefix("observation/images/")
            if camera != name:
                pixels = torch.from_numpy(np.array(picture)).permute(2, 0, 1)
                seen[f"{OBS_IMAGES}.{camera}"] = pixels.float() / 255.0
        seen["task"] = obs["prompt"]
        batch = self.before(seen)
        # Each call gives one action; the policy keeps the chunk that they are of.
        chunk = [self.after(self.policy.select_action(batch))[0] for _ in range(self.count)]
        return {"actions": torch.stack(chunk).numpy()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", type=Path, help="folder `pretrained_model` of a checkpoint")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    policy = Served(LeRobotPolicy(options.policy))
    serve(policy, port=options.port, on_listening=lambda address: print(address, flush=True))


if __name__ == "__main__":
    main()
