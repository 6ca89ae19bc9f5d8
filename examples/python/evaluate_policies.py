"""Two of the program's controllers and a policy of our own on the same starts, compared in a table.

    python examples/python/evaluate_policies.py [--episodes 4] [-o campaign] [--task grasp-lift]

The first two run as a campaign (what `trocar evaluate` does; it can be stopped and gone on with), the third in an environment.
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
    """Where both arms are, as targets: the five coordinates of each."""
    return np.concatenate([state[:5], state[23:28]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=4)
    parser.add_argument("--task", default="grasp-lift", choices=sorted(trocar.TASKS.values()))
    parser.add_argument("--seconds", type=float, default=15.0, help="longest episode")
    parser.add_argument(
        "-o", "--output", type=Path, help="campaign folder (default: one that is removed)"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        # The built-in scene with another task: a scene is a file, and this one leaves everything else as it is.
        text = SCENE.read_text().replace('name = "appendix-resection"', f'name = "{options.task}"')
        scene = Path(folder) / "scene.toml"
        scene.write_text(text.replace("episode_s = 40.0", f"episode_s = {options.seconds}"))
        output = options.output or Path(folder) / "campaign"
        result = campaign.run(str(scene), ["scripted", "random"], output, episodes=options.episodes)
        print(f"{'policy':<12} {'passed':>7} {'95% interval':>13} {'score':>6}")
        for row in result["policies"]:
            low, high = row["interval"]["low"], row["interval"]["high"]
            print(
                f"{row['policy']:<12} {row['passed']:>3}/{row['episodes']:<3} {low:>6.0%} -{high:>4.0%} {row['mean_score']:>7.2f}"
            )

    name = next(name for name, task in trocar.TASKS.items() if task == options.task)
    env = gym.make(name, episode_s=options.seconds)
    scores = []
    for seed in range(options.episodes):
        state, info = env.reset(seed=seed)
        over = False
        while not over:
            state, _, ended, late, info = env.step(stand_still(state).astype(np.float32))
            over = ended or late
        scores.append((info["is_success"], info["score"]))
    print(
        f"{'stand still':<12} {sum(s for s, _ in scores):>3}/{len(scores):<3} {'':>13} {np.mean([x for _, x in scores]):>6.2f}"
    )


if __name__ == "__main__":
    main()
