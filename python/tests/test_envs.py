"""One cell fulfils Gymnasium's contract: seeds, saved states, ends, errors by name."""

import os
import signal
import subprocess
import sys
import threading
import time
import typing

import gymnasium as gym
import numpy as np
import pytest
from conftest import SHORT, actions_of, changed_scene, rollout
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env

import trocar

NAMES = list(trocar.TASKS)


@pytest.mark.parametrize("name", NAMES)
def test_the_environment_passes_gymnasiums_checker(name):
    env = gym.make(name, **SHORT)
    assert type(env) is trocar.TrocarEnv, "nothing is wrapped around it that hides its attributes"
    # The check of `close` builds another cell; it runs for one environment.
    check_env(env, skip_render_check=True, skip_close_check=name != NAMES[0])
    assert env.unwrapped.task_description and env.unwrapped._max_episode_steps == 12
    assert len(env.unwrapped.state_names) == env.observation_space.shape[0]
    assert len(env.unwrapped.action_names) == env.action_space.shape[0] == 10


def test_a_seed_and_a_saved_state_give_the_same_bits(one):
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


def test_the_last_step_says_why_it_ended(one):
    actions = actions_of(one, 5, 12)
    one.reset(seed=1)
    for action in actions:
        *_, ended, late, info = one.step(action)
    assert late and not ended
    assert info["end"] == "time-out" and not info["is_success"] and "time was up" in info["why"]
    assert info["summary"]["simulated_s" if "simulated_s" in info["summary"] else "end"] is not None
    assert info["summary"]["punctures"] == info["summary"]["pierced"] == 0
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
        ({"scene": "cell-d"}, "cell-d"),
        ({"obs": "smell"}, "smell"),
        ({"actions": "joints"}, "pivots"),
        ({"episode_s": -1.0}, "episode_s"),
        ({"threads": -1}, "threads: is -1"),
        ({"threads": 10**6}, "threads: .* 1024"),
        ({"obs": "state+agent_pos"}, "obs: .*once"),
        ({"image_size": 64}, "image_size: is 64"),
        ({"image_size": (64.5, 64)}, "image_size: .*integers in"),
        ({"image_size": "64"}, "image_size"),
        ({"variation": "some"}, "variation: 'some' .*none, easy, standard, hard"),
        ({"backend": "springs"}, "backend: 'springs' .*tetrahedra, lattice"),
        ({"split": "test"}, "split: 'test' .*seen, unseen, both"),
    ]:
        with pytest.raises(ValueError, match=words):
            trocar.TrocarEnv(**({"task": "grasp-lift"} | options))
    with pytest.raises(ValueError, match="grasp-lift"):
        trocar.TrocarEnv(task="sew")


def test_two_processes_give_the_same_numbers(one):
    script = (
        "import trocar, numpy as np\n"
        "env = trocar.TrocarEnv(task='grasp-lift', episode_s=0.4, threads=1, variation='none')\n"
        "env.reset(seed=3); dice = np.random.default_rng(1)\n"
        "low, high = env.action_space.low, env.action_space.high\n"
        "for _ in range(8): env.step(dice.uniform(low, high))\n"
        "print(env.state_hash)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=os.environ
    )
    one.reset(seed=3)
    dice = np.random.default_rng(1)
    for _ in range(8):
        one.unwrapped.step(dice.uniform(one.action_space.low, one.action_space.high))
    assert int(printed.stdout) == one.unwrapped.state_hash


def test_a_reset_tells_what_was_drawn(one):
    drawn = one.reset(seed=3)[1]["drawn"]
    assert drawn["specimen"] == "phantom-a:1" and abs(drawn["left.tilt_deg"]) <= 1.0
    assert "drawn" not in one.step(one.action_space.low)[4]
    assert one.reset(seed=3)[1]["drawn"] == drawn
    assert one.reset(seed=4)[1]["drawn"] != drawn


def test_a_restored_state_has_its_seed_and_draws_the_same_seeds(one):
    one.reset(seed=3)
    saved = one.save_state()
    after = [one.reset()[1]["seed"] for _ in range(2)]
    one.reset(seed=4)
    one.restore_state(saved)
    *_, info = one.step(one.action_space.low)
    assert info["seed"] == 3 and one.np_random_seed == 3
    assert [one.reset()[1]["seed"] for _ in range(2)] == after
    one.restore_state(saved)
    assert [one.reset()[1]["seed"] for _ in range(2)] == after, "a saved state stays as it was"


def test_a_state_of_another_scene_is_refused_and_changes_nothing(one, tmp_path):
    other = trocar.TrocarEnv(task="port-reach", **SHORT)
    path = changed_scene(tmp_path, "grasp-lift", 0.4)
    path.write_text(path.read_text().replace("control_hz = 30", "control_hz = 60"))
    faster = trocar.TrocarEnv(str(path), variation="none")
    other.reset(seed=5)
    faster.reset(seed=5)
    one.reset(seed=6)
    before = one.state_hash
    for state, error, words in [
        (other.save_state(), ValueError, "port-reach"),
        (faster.save_state(), ValueError, "another scene"),
        (None, TypeError, "save_state"),
        (3, TypeError, "int"),
    ]:
        with pytest.raises(error, match=f"state: .*{words}"):
            one.restore_state(state)
    *_, info = one.step(one.action_space.low)
    assert info["seed"] == 6 and one.state_hash != before


def test_calls_in_the_wrong_order_raise_without_wrappers():
    env = trocar.TrocarEnv(task="port-reach", render_mode="rgb_array", **SHORT)
    for too_early in (lambda: env.step(env.action_space.low), env.render, env.save_state):
        with pytest.raises(ResetNeeded, match="reset first"):
            too_early()
    env.reset(seed=1)
    env.step(env.action_space.low)
    saved = env.save_state()
    env.close()
    env.close()
    for too_late in (
        env.reset,
        lambda: env.step(env.action_space.low),
        env.render,
        env.save_state,
        lambda: env.restore_state(saved),
    ):
        with pytest.raises(ClosedEnvironmentError, match="closed"):
            too_late()
    assert env.cells._native is None, "the cell is freed"
    assert env.task == "port-reach" and len(env.state_names) == env.observation_space.shape[0]


def test_wrong_seeds_are_refused_by_name(one):
    assert (
        one.reset(seed=np.int64(3))[1]["seed"] == 3
        and one.reset(seed=10**6 - 1)[1]["seed"] == 10**6 - 1
    )
    for seed in (-1, 10**6, 2**63, 2**64, 1.5):
        with pytest.raises(ValueError, match="seed: is "):
            one.reset(seed=seed)


def test_training_does_not_reach_unseen_episodes(tmp_path):
    # Two anatomies of the same folder: one is seen, the other is not.
    lines = [
        "[variation.specimens]",
        'phantoms = ["phantom-a"]',
        "seeds = [1, 1]",
    ]
    path = changed_scene(tmp_path, "grasp-lift", 0.1)
    path.write_text(path.read_text() + "\n".join(["", *lines, ""]))
    seen = trocar.TrocarEnv(str(path), variation="easy")
    assert all(seen.reset()[1]["seed"] < 10**6 for _ in range(3))
    with pytest.raises(
        ValueError, match=r"seed: is 1000000; seeds of split seen are in \[0, 999999"
    ):
        seen.reset(seed=10**6)
    unseen = trocar.TrocarEnv(str(path), variation="easy", split="unseen")
    assert unseen.reset()[1]["seed"] >= 10**6
    info = unseen.reset(seed=10**6 + 3)[1]
    assert info["seed"] == 10**6 + 3 and "modulus_kpa" in info["drawn"]
    with pytest.raises(ValueError, match="seed: is 3; seeds of split unseen"):
        unseen.reset(seed=3)


def test_an_environment_varies_unless_it_is_told_otherwise(lift_scene, monkeypatch, tmp_path):
    # The scene names one anatomy, so that no others are made.
    path = changed_scene(tmp_path, "grasp-lift", 0.1)
    one_anatomy = '\n[variation.specimens]\nphantoms = ["phantom-a"]\nseeds = [1, 1]\n'
    path.write_text(path.read_text() + one_anatomy)
    drawn = trocar.TrocarEnv(str(path)).reset(seed=0)[1]["drawn"]
    assert {"modulus_kpa", "friction", "endoscope.camera_shift_mm.x"} <= set(drawn)
    fixed = trocar.TrocarEnv(str(path), variation="none").reset(seed=0)[1]["drawn"]
    assert "modulus_kpa" not in fixed and "left.tilt_deg" in fixed


def test_the_state_alone_can_be_in_a_dict():
    env = trocar.TrocarEnv(task="grasp-lift", obs="agent_pos", **SHORT)
    check_env(env, skip_render_check=True, skip_close_check=True)
    assert set(env.observation_space) == {"agent_pos"} and set(env.reset(seed=1)[0]) == {
        "agent_pos"
    }


def test_the_rate_is_that_of_the_scene(one, tmp_path):
    path = changed_scene(tmp_path, "port-reach", 0.5)
    path.write_text(path.read_text().replace("control_hz = 30", "control_hz = 60"))
    env = trocar.TrocarEnv(str(path), variation="none")
    assert env.metadata["render_fps"] == 60 and one.metadata["render_fps"] == 30
    assert trocar.TrocarEnv.metadata["render_fps"] == 30, "the class is as it was"
    envs = trocar.TrocarVectorEnv(1, str(path), variation="none")
    assert envs.metadata["render_fps"] == envs.envs[0].metadata["render_fps"] == 60


def test_types_of_options_can_be_resolved():
    for kind in (trocar.TrocarEnv, trocar.TrocarVectorEnv):
        assert "options" in typing.get_type_hints(kind.__init__)


def refuses(use):
    """Whether `use` raises because the environment belongs to another process."""
    try:
        use()
    except RuntimeError as why:
        return "another process" in str(why)
    return False


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the platform has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_is_refused_and_makes_its_own(one):
    one.reset(seed=1)
    saved = one.save_state()
    child = os.fork()
    if child == 0:
        # No code of pytest may run in the child.
        try:
            signal.alarm(60)
            refused = [
                refuses(use)
                for use in (
                    lambda: one.reset(seed=1),
                    lambda: one.step(one.action_space.low),
                    one.save_state,
                    lambda: one.restore_state(saved),
                    lambda: one.cells.render(0),
                )
            ]
            own = trocar.TrocarEnv(task="grasp-lift", **SHORT)
            own.reset(seed=1)
            own.step(own.action_space.low)
            os._exit(sum(refused))
        finally:
            os._exit(99)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 5
    one.step(one.action_space.low)


@pytest.mark.skipif(os.name == "nt", reason="a process cannot be sent Ctrl-C so")
def test_ctrl_c_stops_the_construction_of_many_cells():
    # Making all of them would take much longer.
    press = threading.Timer(2.0, os.kill, (os.getpid(), signal.SIGINT))
    press.start()
    began = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            trocar.TrocarVectorEnv(400, task="port-reach", threads=2)
    finally:
        press.cancel()
    assert time.monotonic() - began < 30
