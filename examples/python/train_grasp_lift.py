"""Reinforcement learning on GraspLift: Stable-Baselines3's SAC moves the left tip to the appendix, and draws its learning curve.

    pip install stable-baselines3 matplotlib
    python examples/python/train_grasp_lift.py --steps 20000

The reward is shaped with what only a simulator knows (how far the jaws are from the tissue). The state is what the robot measures,
with the place of the left tip. This is a start, not a solution: no run of it has been long enough to pass the task. The printed
figures say how far a run came.
"""

import argparse
from pathlib import Path

import gymnasium as gym
import numpy as np
import trocar  # noqa: F401  (registers the environments)

#: Of the state: the left arm's coordinates, its tip [m], whether its jaws hold tissue; then the stage.
SEEN = [0, 1, 2, 3, 4, 10, 11, 12, 22, 46]


class Reach(gym.Wrapper):
    """The left arm alone, with a reward for coming near to the tissue, for holding it and for each stage."""

    def __init__(self, env: gym.Env, every: int = 3):
        super().__init__(env)
        self.every = every
        self.action_space = gym.spaces.Box(-1.0, 1.0, (5,), np.float32)
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (len(SEEN),), np.float32)
        self.distance = 0.0

    def _seen(self, state: np.ndarray) -> np.ndarray:
        seen = state[SEEN].copy()
        # Metres and radians to numbers of about one.
        seen[:2] *= 5.0
        seen[2] = (seen[2] - 0.1) * 20.0
        seen[5:8] = (seen[5:8] - np.array([0.0, 0.46, 0.06], np.float32)) * 20.0
        return seen

    def _distance(self) -> float:
        return 1e-3 * self.unwrapped.privileged_channels["grasp_distance_mm"]

    def reset(self, **options):
        state, info = self.env.reset(**options)
        self.distance = None
        return self._seen(state), info

    def step(self, action):
        total, over = 0.0, False
        whole = np.concatenate([action, np.zeros(5, np.float32)])
        for _ in range(self.every):
            state, reward, ended, late, info = self.env.step(whole)
            total += 5.0 * reward
            over = ended or late
            if over:
                break
        now = self._distance()
        if np.isfinite(now):
            if self.distance is not None:
                total += 100.0 * (self.distance - now)
            self.distance = now
        info["distance_m"] = now
        return self._seen(state), total + 0.2 * float(state[22] > 0.5), ended, late, info


def make(seconds: float) -> gym.Env:
    env = gym.make("trocar/GraspLift-v0", actions="tip", normalize=True, episode_s=seconds, threads=1, privileged=True)
    return Reach(env)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=20_000, help="decisions, ten a second")
    parser.add_argument("--seconds", type=float, default=6.0, help="longest episode")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=Path("grasp_lift.png"))
    options = parser.parse_args()

    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import BaseCallback

    torch.set_num_threads(1)

    class Log(BaseCallback):
        """Return, least distance and success of every episode."""

        def __init__(self):
            super().__init__()
            self.rows, self.total, self.near = [], 0.0, np.inf

        def _on_step(self) -> bool:
            info = self.locals["infos"][0]
            self.total += float(self.locals["rewards"][0])
            self.near = min(self.near, info["distance_m"])
            if self.locals["dones"][0]:
                self.rows.append((self.num_timesteps, self.total, 1e3 * self.near, info["stage"], info["is_success"]))
                self.total, self.near = 0.0, np.inf
            return True

    log = Log()
    model = SAC("MlpPolicy", make(options.seconds), seed=options.seed, learning_starts=500, batch_size=128, train_freq=4, gradient_steps=2)
    model.learn(options.steps, callback=log)
    rows = np.array(log.rows, dtype=float)
    if not len(rows):
        print("no episode was finished; give it more --steps")
        return
    part = max(1, len(rows) // 5)
    for words, some in (("first fifth", rows[:part]), ("last fifth", rows[-part:])):
        print(
            f"{words}: {len(some)} episodes, return {some[:, 1].mean():.2f}, nearest {np.median(some[:, 2]):.1f} mm (median), "
            f"{(some[:, 3] > 0).mean():.0%} grasped, {some[:, 4].mean():.0%} passed"
        )
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 6))
    for axis, column, label in ((axes[0], 1, "return"), (axes[1], 2, "least distance from jaws to tissue [mm]")):
        axis.plot(rows[:, 0], rows[:, column], ".", alpha=0.3)
        smooth = np.convolve(rows[:, column], np.ones(part) / part, "valid")
        axis.plot(rows[part - 1 :, 0], smooth)
        axis.set_ylabel(label)
    axes[1].set_xlabel("decisions")
    axes[0].set_title("SAC on GraspLift, left arm, steps of the tip")
    figure.tight_layout()
    figure.savefig(options.output, dpi=120)
    print(f"written: {options.output}")


if __name__ == "__main__":
    main()
