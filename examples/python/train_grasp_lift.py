"""Reinforcement learning on GraspLift by SAC of Stable-Baselines3, with scripted demonstrations.

    pip install stable-baselines3 matplotlib
    python examples/python/train_grasp_lift.py --decisions 3000

The policy sets the left arm's five targets, five times a second; the right arm stands still. It
observes what a robot measures (coordinates, tip, force, whether the jaws hold tissue, the stage).
Only the reward is privileged: the gain in stages, and how much nearer the jaws came to the organ. A
policy on a robot does not need it.

The replay buffer begins with demonstrations of the built-in controller `scripted`, and half of each
batch is drawn from them (Ball et al. 2023, RLPD). The policy itself starts from random weights.
`--demonstrations 0` runs without them. The result is a learning curve.
"""

import argparse
import time
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import create_mlp
from stable_baselines3.common.vec_env import VecEnv

import trocar

#: Control steps (1/30 s) of one decision.
EVERY = 6
#: Change of the targets by an action of 1 in a decision: two pivot angles (rad), insertion (m),
#: roll (rad). The fifth number of an action is the jaw: -1 is closed, 1 is open.
STEP = np.array([0.07, 0.07, 0.009, 0.35])
#: The left arm's numbers in an action and in a state, and the index of its jaw.
ARM, JAW = slice(0, 5), 4
#: Number of episodes in the reported rates and means.
PART = 20
#: Widths of the networks' hidden layers.
NET = [128, 128]
#: Length of the decay of the reward for distance to the organ (mm).
NEAR_MM = 10.0


class LiftCells(VecEnv):
    """Cells of GraspLift for Stable-Baselines3, with a shaped reward.

    An action moves the left arm only, for 0.2 s.
    """

    def __init__(self, options: argparse.Namespace, seed: int, split: str):
        cells = options.cells
        envs = gym.make_vec(
            "trocar/GraspLift-v0",
            num_envs=cells,
            vectorization_mode="vector_entry_point",
            autoreset_mode="same-step",
            episode_s=options.seconds,
            privileged=True,
            variation=options.variation,
            split=split,
            threads=options.threads,
        )
        # Its own attributes are not in Gymnasium's types.
        self.cells = cast(Any, envs)
        space = self.cells.single_action_space
        assert isinstance(space, gym.spaces.Box)
        self.low, self.high = space.low.astype(float), space.high.astype(float)
        channel_names: list[str] = self.cells.channel_names
        self.distance_column = channel_names.index("grasp_distance_mm")
        self.seed_first = seed
        self._start = np.zeros((cells, 10))
        self.render_mode = None
        super().__init__(
            cells,
            gym.spaces.Box(-np.inf, np.inf, (21,), np.float32),
            gym.spaces.Box(-1.0, 1.0, (5,), np.float32),
        )

    def reset(self) -> np.ndarray:
        self.state, infos = self.cells.reset(seed=self.seed_first)
        self.targets = np.zeros((self.num_envs, 10))
        self.near = self._near(infos["channels"])
        self._stay(np.ones(self.num_envs, bool))
        self.returns, self.lengths = np.zeros(self.num_envs), np.zeros(self.num_envs, int)
        return self._seen(self.state, self.targets)

    def _stay(self, which: np.ndarray) -> None:
        """Sets the targets of the flagged cells to the current coordinates of their arms."""
        self.targets[which, :5], self.targets[which, 5:] = (
            self.state[which, :5],
            self.state[which, 23:28],
        )

    def _near(self, channels: np.ndarray) -> np.ndarray:
        """From 1 with the jaws at the organ to 0 far away.

        0 before an episode's first step, when its channels are all 0.
        """
        distance = channels[..., self.distance_column]
        return np.where(distance > 0.0, np.exp(-distance / NEAR_MM), 0.0)

    def _seen(self, state: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """The policy's observation (..., 21), scaled to about 1.

        Coordinates, targets relative to them, rates, tip, force, whether the jaws hold, stage.
        """
        scale = np.array([0.3, 0.3, 0.05, 1.0, 1.0])
        here = state[..., ARM]
        parts = [
            (here - np.array([0.0, 0.0, 0.1, 0.0, 0.5])) / scale,
            (targets[..., ARM] - here)[..., :4] / STEP,
            state[..., 5:9] * EVERY / 30.0 / STEP,
            (state[..., 10:13] - np.array([0.0, 0.46, 0.06])) / 0.05,
            state[..., 18:21],
            state[..., 22:23],
            state[..., 46:47],
        ]
        return np.concatenate(parts, -1).astype(np.float32)

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = np.asarray(actions, float)

    def step_wait(self):
        goal = self.targets[:, ARM].copy()
        goal[:, :4] += self.actions[:, :4] * STEP
        goal[:, JAW] = 0.5 * (self.actions[:, JAW] + 1.0)
        goal = np.clip(goal, self.low[ARM], self.high[ARM])
        start = self.targets[:, ARM].copy()
        start[:, JAW] = goal[:, JAW]

        def row(k: int) -> np.ndarray:
            self.targets[:, ARM] = start + (k + 1) / EVERY * (goal - start)
            return self.targets

        return self._decide(row)

    def demonstrate(self, experts: list[trocar.Policy]):
        """A decision of the built-in controllers.

        Returns the observations before, the equivalent actions, and the result of `step_wait`.
        """
        before, start = self._seen(self.state, self.targets), self.targets.copy()

        def row(_: int) -> np.ndarray:
            self.targets = np.stack([expert(self.cells, k) for k, expert in enumerate(experts)])
            # The recorded action is that of the last step before a restart.
            done[~self.fresh] = self.targets[~self.fresh]
            return self.targets

        done = start.copy()
        after, rewards, over, infos = self._decide(row, experts)
        actions = np.concatenate([(done[:, :4] - start[:, :4]) / STEP, 2.0 * done[:, 4:5] - 1.0], 1)
        return before, np.clip(actions, -1.0, 1.0).astype(np.float32), after, rewards, over, infos

    def _decide(self, row, experts: list[trocar.Policy] | None = None):
        """Runs the control steps of one decision.

        A cell whose episode ends during it waits at its new start for the others.
        """
        rewards, over, self.fresh = (
            np.zeros(self.num_envs),
            np.zeros(self.num_envs, bool),
            np.zeros(self.num_envs, bool),
        )
        infos: list[dict] = [{} for _ in range(self.num_envs)]
        for step in range(EVERY):
            actions = row(step).copy()
            if self.fresh.any() and experts is None:
                actions[self.fresh] = self._start[self.fresh]
            self.state, gain, ended, late, told = self.cells.step(actions)
            going = ~self.fresh
            rewards[going] += 2.0 * gain[going]
            ends = (ended | late) & going
            near = self._near(told["channels"])
            for k in np.flatnonzero(ends).tolist():
                last = told["final_info"]
                seen = self._seen(told["final_obs"][k], actions[k])
                passed = bool(last["is_success"][k])
                rewards[k] += self._near(last["channels"][k]) - self.near[k] + 3.0 * passed
                infos[k] = {
                    "terminal_observation": seen,
                    "TimeLimit.truncated": bool(late[k]),
                    "is_success": passed,
                }
                infos[k]["stage"] = int(last["stage"][k])
                self.near[k] = near[k]
                if experts is not None:
                    experts[k].reset(self.cells, k)
            if ends.any():
                self.fresh |= ends
                over |= ends
                self._start = np.concatenate([self.state[:, :5], self.state[:, 23:28]], 1).astype(
                    float
                )
        going = ~self.fresh
        rewards[going] += near[going] - self.near[going]
        # A cost for time.
        rewards -= 0.02
        self.near = near
        self._stay(self.fresh) if experts is None else None
        self.returns += rewards
        self.lengths += 1
        for k in np.flatnonzero(over):
            infos[k]["episode"] = {"r": self.returns[k], "l": self.lengths[k]}
            self.returns[k], self.lengths[k] = 0.0, 0
        return self._seen(self.state, self.targets), rewards.astype(np.float32), over, infos

    def close(self) -> None:
        self.cells.close()

    # Stable-Baselines3 asks these of environments.

    def get_attr(self, attr_name, indices=None):
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        setattr(self, attr_name, value)

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise AttributeError(f"one cell has no {method_name}")

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * self.num_envs


class Mixed(ReplayBuffer):
    """A replay buffer that draws half of each batch from demonstrations, if there are any."""

    demonstrations: ReplayBuffer | None = None

    def sample(self, batch_size, env=None):
        if self.demonstrations is None:
            return super().sample(batch_size, env)
        half = batch_size // 2
        parts = super().sample(batch_size - half, env), self.demonstrations.sample(half, env)
        joined = [None if a is None else torch.cat([a, b]) for a, b in zip(*parts)]
        return type(parts[0])(*joined)


def normalized(model: SAC, net: list[int]) -> None:
    """Adds layer normalization to the critics, which bounds values of unseen actions (RLPD)."""
    inputs = model.observation_space.shape[0] + model.action_space.shape[0]
    for critic in (model.critic, model.critic_target):
        for k in range(critic.n_critics):
            made = torch.nn.Sequential(
                *create_mlp(inputs, 1, net, torch.nn.ReLU, post_linear_modules=[torch.nn.LayerNorm])
            )
            setattr(critic, f"qf{k}", made)
            critic.q_networks[k] = made
    model.critic_target.load_state_dict(model.critic.state_dict())
    model.critic.optimizer = torch.optim.Adam(model.critic.parameters(), lr=model.lr_schedule(1.0))


def demonstrations(envs: LiftCells, episodes: int) -> tuple[ReplayBuffer, list[bool]]:
    """Transitions of the scripted controller's episodes, and which of them passed."""
    kept = ReplayBuffer(
        200 * episodes, envs.observation_space, envs.action_space, handle_timeout_termination=True
    )
    experts = [trocar.Policy("scripted") for _ in range(envs.num_envs)]
    envs.reset()
    for k, expert in enumerate(experts):
        expert.reset(envs.cells, k)
    rows: list[list[tuple]] = [[] for _ in experts]
    passed: list[bool] = []
    while len(passed) < episodes:
        before, actions, after, rewards, over, infos = envs.demonstrate(experts)
        for k in range(envs.num_envs):
            seen = infos[k].get("terminal_observation", after[k])
            rows[k].append((before[k], seen, actions[k], rewards[k], over[k], [infos[k]]))
            if over[k] and len(passed) < episodes:
                passed.append(infos[k]["is_success"])
                for seen, then, action, reward, end, info in rows[k]:
                    kept.add(
                        seen[None],
                        then[None],
                        action[None],
                        np.array([reward]),
                        np.array([end]),
                        info,
                    )
            if over[k]:
                rows[k] = []
    return kept, passed


def test(model: SAC, options: argparse.Namespace) -> list[bool]:
    """Which unseen episodes the policy passes without exploration.

    The number of episodes of each cell is fixed beforehand: episodes that pass end early, so the
    first ones to end are a biased sample.
    """
    envs = LiftCells(options, 1_000_000, "unseen")
    cells = options.cells
    left = np.full(cells, options.test // cells)
    left[: options.test % cells] += 1
    seen, passed = envs.reset(), []
    while left.any():
        envs.step_async(model.predict(seen, deterministic=True)[0])
        seen, _, over, infos = envs.step_wait()
        for k in np.flatnonzero(over & (left > 0)):
            passed.append(infos[k]["is_success"])
            left[k] -= 1
    return passed


class Log(BaseCallback):
    """Records decisions so far, minutes, return, stage and success of every episode."""

    def __init__(self):
        super().__init__()
        self.rows, self.begun = [], time.perf_counter()

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                minutes = (time.perf_counter() - self.begun) / 60.0
                self.rows.append(
                    (
                        self.num_timesteps,
                        minutes,
                        info["episode"]["r"],
                        info["stage"],
                        info["is_success"],
                    )
                )
                if len(self.rows) % PART == 0:
                    last = np.array(self.rows[-PART:], float)
                    grasped = np.mean(last[:, 3] > 0)
                    print(
                        f"{self.num_timesteps} decisions, {minutes:.1f} min, "
                        f"{len(self.rows)} episodes; last {PART}: return {last[:, 2].mean():.2f}, "
                        f"grasped {grasped:.0%}, passed {last[:, 4].mean():.0%}",
                        flush=True,
                    )
        return True


def draw(rows: np.ndarray, path: Path, script: float | None) -> None:
    """The learning curve: success and return of the episodes against decisions."""

    def smooth(values: np.ndarray) -> np.ndarray:
        return np.array([values[max(0, k + 1 - PART) : k + 1].mean() for k in range(len(values))])

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 6))
    axes[0].plot(rows[:, 0], smooth(rows[:, 3] > 0), label="grasped")
    axes[0].plot(rows[:, 0], smooth(rows[:, 4]), label="passed: lifted and held")
    axes[0].set_ylabel(f"share of the last {PART} episodes")
    axes[0].set_ylim(-0.02, 1.02)
    axes[0].legend(loc="lower right")
    axes[1].plot(rows[:, 0], rows[:, 2], ".", alpha=0.3)
    axes[1].plot(rows[:, 0], smooth(rows[:, 2]))
    if script is not None:
        axes[1].axhline(script, color="grey", linestyle=":", label="scripted controller")
        axes[1].legend(loc="lower right")
    axes[1].set_ylabel("return (shaped)")
    axes[1].set_xlabel(f"decisions ({EVERY / 30:.1f} s of simulated time each)")
    axes[0].set_title("SAC on GraspLift, exploration included")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--decisions", type=int, default=3000, help="five a second of simulated time"
    )
    parser.add_argument(
        "--demonstrations", type=int, default=10, help="scripted episodes in the replay buffer"
    )
    parser.add_argument("--cells", type=int, default=4)
    parser.add_argument(
        "--seconds", type=float, default=7.0, help="maximum duration of an episode (s)"
    )
    parser.add_argument(
        "--test", type=int, default=20, help="unseen episodes of the test at the end"
    )
    parser.add_argument(
        "--variation",
        default="none",
        help="what varies: none (the fixed cell, in which only the starts of the arms vary), easy, "
        "standard or hard (default: %(default)s)",
    )
    parser.add_argument("--threads", type=int, default=0, help="0 for as many as there are cores")
    parser.add_argument("--updates", type=int, default=6, help="gradient steps a decision")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=Path("grasp_lift.png"))
    options = parser.parse_args()
    torch.set_num_threads(1)

    envs = LiftCells(options, options.seed, "seen")
    model = SAC(
        "MlpPolicy",
        envs,
        seed=options.seed,
        gamma=0.96,
        learning_rate=5e-4,
        batch_size=256,
        learning_starts=100,
        # Rewards are about 0.1: with the default initial weight of 1, entropy would dominate them
        # for a long time.
        ent_coef="auto_0.02",
        train_freq=1,
        gradient_steps=options.cells * options.updates,
        replay_buffer_class=Mixed,
        policy_kwargs={"net_arch": NET},
    )
    normalized(model, NET)
    script = None
    if options.demonstrations:
        kept, passed = demonstrations(envs, options.demonstrations)
        model.replay_buffer.demonstrations = kept
        script = float(kept.rewards[: kept.size()].sum() / options.demonstrations)
        print(
            f"demonstrations: {sum(passed)} of {len(passed)} pass, return {script:.2f}, "
            f"{kept.size()} decisions",
            flush=True,
        )
        kept.device = model.device
    log = Log()
    model.learn(options.decisions, callback=log)
    rows = np.array(log.rows, dtype=float)
    if not len(rows):
        print("no episode was finished; try more --decisions")
        return
    options.output.parent.mkdir(parents=True, exist_ok=True)
    model.save(options.output.with_suffix(".zip"))
    np.savetxt(
        options.output.with_suffix(".csv"),
        rows,
        delimiter=",",
        header="decisions,minutes,return,stage,passed",
        fmt="%.4g",
    )
    draw(rows, options.output, script)
    if options.test:
        passed = test(model, options)
        print(f"after: {sum(passed)} of {len(passed)} unseen episodes passed, without exploration")
    print(f"written: {options.output}")


if __name__ == "__main__":
    main()
