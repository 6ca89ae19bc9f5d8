"""Compares two built-in controllers and a policy of our own on the same episodes, in a table.

    python examples/python/evaluate_policies.py [--episodes 4] [-o campaign] [--task grasp-lift]

The first two run as a campaign, as `trocar evaluate` does; it can be stopped and
resumed. The third runs in an environment.
"""

import argparse
import tempfile
from pathlib import Path

import gymnasium as gym
import numpy as np

import trocar
from trocar import campaign

SCENE = Path(__file__).parents[2] / "crates/scene/scenes/cell-a.toml"


def stand_still(state: np.ndarray) -> np.ndarray:
    """The current coordinates of both arms as targets: (10,) from a state (47,)."""
    return np.concatenate([state[:5], state[23:28]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=4)
    parser.add_argument("--task", default="grasp-lift", choices=sorted(trocar.TASKS.values()))
    parser.add_argument("--seconds", type=float, default=15.0, help="longest episode")
    parser.add_argument(
        "--variation",
        default="none",
        help="what varies: none, easy, standard or hard (default: %(default)s; the anatomies of "
        "standard take minutes to make)",
    )
    parser.add_argument(
        "-o", "--output", type=Path, help="campaign folder (default: one that is removed)"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        # The built-in scene as a file with another task and duration.
        text = SCENE.read_text().replace('name = "appendix-resection"', f'name = "{options.task}"')
        scene = Path(folder) / "scene.toml"
        scene.write_text(text.replace("episode_s = 40.0", f"episode_s = {options.seconds}"))
        output = options.output or Path(folder) / "campaign"
        result = campaign.run(
            str(scene),
            ["scripted", "random"],
            output,
            episodes=options.episodes,
            variation=options.variation,
        )
        print(f"{'policy':<12} {'passed':>7} {'95% interval':>13} {'score':>6}")
        for row in result["policies"]:
            low, high = row["interval"]["low"], row["interval"]["high"]
            passed = f"{row['passed']:>3}/{row['episodes']:<3}"
            interval = f"{low:>6.0%} -{high:>4.0%}"
            print(f"{row['policy']:<12} {passed} {interval} {row['mean_score']:>7.2f}")

    name = next(name for name, task in trocar.TASKS.items() if task == options.task)
    env = gym.make(name, episode_s=options.seconds, variation=options.variation)
    scores = []
    for seed in range(options.episodes):
        state, info = env.reset(seed=seed)
        over = False
        while not over:
            state, _, ended, late, info = env.step(stand_still(state).astype(np.float32))
            over = ended or late
        scores.append((info["is_success"], info["score"]))
    passed = f"{sum(success for success, _ in scores):>3}/{len(scores):<3}"
    mean_score = np.mean([score for _, score in scores])
    print(f"{'stand still':<12} {passed} {'':>13} {mean_score:>6.2f}")


if __name__ == "__main__":
    main()
