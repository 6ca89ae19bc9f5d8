"""Records scripted demonstrations with pictures as a LeRobot dataset, and reads it back.

    pip install '.[datasets]'
    python examples/python/record_demonstrations.py --episodes 2 -o lifts

The dataset has LeRobot's layout v3.0 (`--version v2.1` for the older one).
"""

import argparse
import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pandas as pd

import trocar
from trocar.datasets import LeRobotWriter, Recorder, features_of


def record(
    output: Path, episodes: int, size: int, version: str, seconds: float | None, variation: str
) -> int:
    """Records the scripted controller's episodes that pass. Returns their number."""
    env = gym.make(
        "trocar/GraspLift-v0",
        obs="state+rgb",
        image_size=(size, size),
        episode_s=seconds,
        variation=variation,
    )
    writer = LeRobotWriter(output, fps=30, features=features_of(env), version=version)
    recorder, expert, passed = (
        Recorder(env, writer, only_successful=True),
        trocar.Policy("scripted"),
        0,
    )
    for seed in range(episodes):
        recorder.reset(seed=seed)
        expert.reset(env)
        over = False
        while not over:
            _, _, ended, late, info = recorder.step(expert(env))
            over = ended or late
        passed += info["is_success"]
        print(f"seed {seed}: {info['end']} after {info['time_s']:.1f} s")
    return passed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--size", type=int, default=224, help="edge of the pictures (px)")
    parser.add_argument("--seconds", type=float, help="maximum duration (s) (default: the scene's)")
    parser.add_argument(
        "--variation",
        default="none",
        help="what varies: none, easy, standard or hard (default: %(default)s; the anatomies of "
        "standard take minutes to make)",
    )
    parser.add_argument("--version", default="v3.0", choices=["v3.0", "v2.1"])
    parser.add_argument("-o", "--output", type=Path, default=Path("lifts"))
    options = parser.parse_args()
    passed = record(
        options.output,
        options.episodes,
        options.size,
        options.version,
        options.seconds,
        options.variation,
    )
    print(f"{passed} of {options.episodes} passed and are kept")
    if not passed:
        return
    info = json.loads((options.output / "meta/info.json").read_text())
    table = pd.concat(map(pd.read_parquet, sorted((options.output / "data").rglob("*.parquet"))))
    states = np.stack(table["observation.state"])
    print(f"{info['total_episodes']} episodes, {info['total_frames']} frames")
    print(f"features: {', '.join(info['features'])}")
    print(f"states {states.shape}, actions {np.stack(table['action']).shape}, videos:")
    for path in sorted((options.output / "videos").rglob("*.mp4")):
        print(f"  {path.relative_to(options.output)} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
