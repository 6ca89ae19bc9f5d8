"""Records scripted demonstrations with pictures as a LeRobot dataset, and reads it back.

    pip install '.[datasets]'
    python examples/python/record_demonstrations.py --episodes 2 -o lifts

The dataset has LeRobot's layout v3.0 (`--version v2.1` for the older one). It is safe to stop at
any time: the same command continues. `--keep 200` stops once 200 have passed. `--noise 0.5`
disturbs what the arm does, but records what the controller wanted: the dataset then shows how to
come back from mistakes, which a cloned policy makes (Laskey et al. 2017, DART).
"""

import argparse
import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd

import trocar
from trocar.datasets import LeRobotWriter, Recorder, features_of

#: Standard deviation of the noise of `--noise 1` on the left arm's two pivots (rad), insertion (m)
#: and roll (rad): about 3 mm at the tip. That of the built-in policy `noise`.
NOISE = np.array([0.03, 0.03, 0.003, 0.3])
#: Steps between two draws of the noise; it goes straight in between.
NOISE_STEPS = 15
#: The left jaw in an action, and the opening from which on the jaws are not meant to close.
JAW, OPEN = 4, 0.45


class Disturbed(gym.ActionWrapper[Any, Any, Any]):
    """Adds noise to the targets of the left arm while its jaws are open. Seeded by the episode.

    A `Recorder` around it writes actions without the noise.
    """

    def __init__(self, env: gym.Env[Any, Any], scale: float):
        super().__init__(env)
        self.scale = scale

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        self.dice, self.count = np.random.default_rng(options["seed"]), 0
        # Nothing at first.
        self.last, self.next = np.zeros(4), self.dice.normal(size=4)
        return super().reset(**options)

    def action(self, action: np.ndarray) -> np.ndarray:
        if self.count and self.count % NOISE_STEPS == 0:
            self.last, self.next = self.next, self.dice.normal(size=4)
        share = self.count % NOISE_STEPS / NOISE_STEPS
        self.count += 1
        disturbed = np.array(action)
        if action[JAW] >= OPEN:
            noise = (1.0 - share) * self.last + share * self.next
            disturbed[:4] += self.scale * NOISE * noise
        assert isinstance(self.action_space, gym.spaces.Box)
        return disturbed.clip(self.action_space.low, self.action_space.high)


def continued(log: Path, kept: int) -> list[tuple[int, bool]]:
    """Seeds that are recorded, and whether they passed. `kept` is the number in the dataset."""
    rows = json.loads(log.read_text()) if log.exists() else []
    done = [(seed, passed) for seed, passed in rows]
    passed = sum(passed for _, passed in done)
    # It was stopped between the episode and its row.
    if kept == passed + 1:
        done.append((done[-1][0] + 1 if done else 0, True))
    elif kept != passed:
        raise SystemExit(f"{log}: has {passed} passed episodes, the dataset has {kept}")
    return done


def record(options: argparse.Namespace) -> list[tuple[int, bool]]:
    """Records the scripted controller's episodes that pass. Returns all seeds, and which passed."""
    env = gym.make(
        "trocar/GraspLift-v0",
        scene=options.scene,
        obs="state+rgb",
        cameras=options.cameras,
        image_size=(options.size, options.size),
        episode_s=options.seconds,
        variation=options.variation,
        threads=options.threads,
    )
    features = features_of(env)
    writer = LeRobotWriter(options.output, fps=30, features=features, version=options.version)
    # What the dataset holds does not say which seeds failed.
    log = options.output.with_name(f"{options.output.name}.seeds.json")
    done = continued(log, writer.episodes)
    recorder = Recorder(Disturbed(env, options.noise), writer, only_successful=True)
    expert = trocar.Policy("scripted")
    for seed in range(len(done), options.episodes):
        if options.keep and sum(passed for _, passed in done) >= options.keep:
            break
        recorder.reset(seed=seed)
        expert.reset(env)
        over = False
        while not over:
            _, _, ended, late, info = recorder.step(expert(env))
            over = ended or late
        done.append((seed, bool(info["is_success"])))
        written = log.with_name(f"{log.name}.partial")
        written.write_text(json.dumps(done))
        written.replace(log)
        print(f"seed {seed}: {info['end']} after {info['time_s']:.1f} s", flush=True)
    return done


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=2, help="most episodes that are run")
    parser.add_argument("--keep", type=int, help="stop once this many have passed (default: never)")
    parser.add_argument("--scene", default="cell-a", help="a built-in scene or a file")
    parser.add_argument("--cameras", nargs="+", help="(default: all but the recording camera)")
    parser.add_argument("--size", type=int, default=224, help="edge of the pictures (px)")
    parser.add_argument("--seconds", type=float, help="maximum duration (s) (default: the scene's)")
    parser.add_argument(
        "--variation",
        default="none",
        help="what varies: none, easy, standard or hard (default: %(default)s; the anatomies of "
        "standard take minutes to make)",
    )
    parser.add_argument(
        "--noise",
        type=float,
        default=0.0,
        help="how much the left arm is disturbed: 1 is about 3 mm at the tip (default: not)",
    )
    parser.add_argument("--threads", type=int, default=0, help="(default: one per core)")
    parser.add_argument("--version", default="v3.0", choices=["v3.0", "v2.1"])
    parser.add_argument("-o", "--output", type=Path, default=Path("lifts"))
    options = parser.parse_args()
    done = record(options)
    passed = sum(passed for _, passed in done)
    print(f"{passed} of {len(done)} passed and are kept")
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
