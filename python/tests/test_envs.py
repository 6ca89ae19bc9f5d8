"""The environments keep Gymnasium's contract, and one cell and many give the same numbers."""

import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import trocar
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from conftest import SHORT

NAMES = list(trocar.TASKS)


@pytest.mark.parametrize("name", NAMES)
def test_gymnasium_finds_nothing_wrong(name):
    env = gym.make(name, **SHORT)
    # The check of closing builds another cell; one environment's is enough.
    check_env(env.unwrapped, skip_render_check=True, skip_close_check=name != NAMES[0])
    assert env.unwrapped.task_description and env.unwrapped._max_episode_steps == 12
    assert len(env.unwrapped.state_names) == env.observation_space.shape[0]
    assert len(env.unwrapped.action_names) == env.action_space.shape[0] == 10


def rollout(env, seed, actions):
    """Observations, rewards and hashes of an episode."""
    seen, _ = env.reset(seed=seed)
    all_seen, rewards, hashes = [seen], [], []
    for action in actions:
        seen, reward, ended, late, _ = env.step(action)
        all_seen.append(seen)
        rewards.append(reward)
        hashes.append(env.unwrapped.state_hash)
        if ended or late:
            break
    return np.array(all_seen), np.array(rewards), hashes


def actions_of(env, seed, count):
    dice = np.random.default_rng(seed)
    low, high = env.action_space.low, env.action_space.high
    return [dice.uniform(low, high).astype(np.float32) for _ in range(count)]


def test_a_seed_gives_the_same_bits_again_and_from_a_saved_state(one):
    actions = actions_of(one, 5, 12)
    first = rollout(one, 7, actions)
    rollout(one, 8, actions_of(one, 6, 4))
    again = rollout(one, 7, actions)
    assert np.array_equal(first[0], again[0]) and first[2] == again[2]
    assert first[2] != rollout(one, 8, actions)[2], "the seed changes the start"
    one.reset(seed=7)
    for action in actions[:5]:
        one.step(action)
    saved = one.unwrapped.save_state()
    for action in actions[5:9]:
        one.step(action)
    assert np.array_equal(one.unwrapped.restore_state(saved), first[0][5])
    for k, action in enumerate(actions[5:], 5):
        seen, *_ = one.step(action)
        assert np.array_equal(seen, first[0][k + 1])
        assert one.unwrapped.state_hash == first[2][k]


def test_the_last_step_says_why(one):
    actions = actions_of(one, 5, 12)
    one.reset(seed=1)
    for action in actions:
        *_, ended, late, info = one.step(action)
    assert late and not ended
    assert info["end"] == "time-out" and not info["is_success"] and "time was up" in info["why"]
    assert info["summary"]["simulated_s" if "simulated_s" in info["summary"] else "end"] is not None
    with pytest.raises(RuntimeError, match="ended"):
        one.step(actions[0])
    one.reset(seed=1)


def test_wrong_actions_are_refused_by_name_and_change_nothing(one):
    one.reset(seed=2)
    before = one.unwrapped.state_hash
    bad = one.action_space.sample()
    bad[7] = np.nan
    with pytest.raises(ValueError, match=r"action\[7\] \(right_insertion\): is NaN"):
        one.unwrapped.step(bad)
    with pytest.raises(ValueError, match="shape"):
        one.unwrapped.step(np.zeros(3))
    assert one.unwrapped.state_hash == before
    for options, words in [
        ({"scene": "cell-b"}, "cell-b"),
        ({"obs": "smell"}, "smell"),
        ({"actions": "joints"}, "pivots"),
        ({"episode_s": -1.0}, "episode_s"),
    ]:
        with pytest.raises(ValueError, match=words):
            trocar.TrocarEnv(**({"task": "grasp-lift"} | options))
    with pytest.raises(ValueError, match="grasp-lift"):
        trocar.TrocarEnv(task="sew")


def test_many_cells_give_what_one_gives(one):
    envs = gym.make_vec("trocar/GraspLift-v0", num_envs=3, vectorization_mode="vector_entry_point", **SHORT)
    assert envs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    actions = [actions_of(one, seed, 12) for seed in (10, 11, 12)]
    alone = [rollout(one, seed, actions[k]) for k, seed in enumerate((10, 11, 12))]
    seen, _ = envs.reset(seed=10)
    for step in range(12):
        assert np.array_equal(seen, np.stack([a[0][step] for a in alone]))
        seen, rewards, ended, late, infos = envs.step(np.stack([a[step] for a in actions]))
        assert np.array_equal(rewards, [a[1][step] for a in alone])
    assert late.all() and not ended.any() and infos["end"].tolist() == ["time-out"] * 3
    # The next step begins new episodes and gives no reward.
    seen, rewards, ended, late, _ = envs.step(np.stack([a[0] for a in actions]))
    assert not late.any() and not rewards.any() and not np.array_equal(seen, np.stack([a[0][0] for a in alone]))
    assert list(envs.call("task")) == ["grasp-lift"] * 3 and len(envs.envs) == 3


def test_the_other_ways_to_begin_anew(one):
    options = {"num_envs": 2, "task": "grasp-lift", "episode_s": 0.1}
    actions = np.stack([actions_of(one, 3, 1)[0]] * 2)
    same = trocar.TrocarVectorEnv(**options, autoreset_mode="same-step")
    same.reset(seed=4)
    for _ in range(3):
        seen, _, _, late, infos = same.step(actions)
    assert late.all() and infos["final_info"]["end"].tolist() == ["time-out"] * 2 and "end" not in infos
    assert not np.array_equal(infos["final_obs"][0], seen[0])
    same.step(actions)
    disabled = trocar.TrocarVectorEnv(**options, autoreset_mode="disabled", copy=False)
    first, _ = disabled.reset(seed=4)
    start = first.copy()
    for _ in range(3):
        disabled.step(actions)
    with pytest.raises(RuntimeError, match="reset_mask"):
        disabled.step(actions)
    again, _ = disabled.reset(seed=4, options={"reset_mask": np.array([True, True])})
    assert again is first and np.array_equal(again, start), "the arrays are the cells' own"


def test_two_processes_give_the_same_numbers(one):
    script = (
        "import trocar, numpy as np; env = trocar.TrocarEnv(task='grasp-lift', episode_s=0.4, threads=1);"
        "env.reset(seed=3); dice = np.random.default_rng(1); low, high = env.action_space.low, env.action_space.high\n"
        "for _ in range(8): env.step(dice.uniform(low, high))\n"
        "print(env.state_hash)"
    )
    printed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=os.environ)
    one.reset(seed=3)
    dice = np.random.default_rng(1)
    for _ in range(8):
        one.unwrapped.step(dice.uniform(one.action_space.low, one.action_space.high))
    assert int(printed.stdout) == one.unwrapped.state_hash
