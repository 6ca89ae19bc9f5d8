"""Many cells give the numbers of one, reset in three ways, and have the attributes of one."""

import weakref

import gymnasium as gym
import numpy as np
import pytest
from conftest import SHORT, actions_of, rollout
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode

import trocar

#: Three steps an episode.
BRIEF = {"task": "grasp-lift", "episode_s": 0.1, "variation": "none"}


@pytest.fixture(scope="module")
def two():
    """Two cells with very short episodes, which reset at the next step."""
    return trocar.TrocarVectorEnv(2, **BRIEF, render_mode="rgb_array", image_size=(32, 48))


def test_many_cells_give_the_numbers_of_one(one):
    envs = gym.make_vec(
        "trocar/GraspLift-v0", num_envs=3, vectorization_mode="vector_entry_point", **SHORT
    )
    assert envs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    actions = [actions_of(one, seed, 12) for seed in (10, 11, 12)]
    alone = [rollout(one, seed, actions[k]) for k, seed in enumerate((10, 11, 12))]
    seen, _ = envs.reset(seed=10)
    for step in range(12):
        assert np.array_equal(seen, np.stack([a[0][step] for a in alone]))
        seen, rewards, ended, late, infos = envs.step(np.stack([a[step] for a in actions]))
        assert np.array_equal(rewards, [a[1][step] for a in alone])
    assert late.all() and not ended.any() and infos["end"].tolist() == ["time-out"] * 3
    # The next step starts new episodes and gives no reward.
    seen, rewards, ended, late, _ = envs.step(np.stack([a[0] for a in actions]))
    assert (
        not late.any()
        and not rewards.any()
        and not np.array_equal(seen, np.stack([a[0][0] for a in alone]))
    )
    assert list(envs.call("task")) == ["grasp-lift"] * 3 and len(envs.envs) == 3


def test_many_cells_on_the_lattice_give_the_numbers_of_one(one):
    brief = BRIEF | {"backend": "lattice"}
    envs = gym.make_vec("trocar/GraspLift-v0", num_envs=2, privileged=True, **brief)
    alone = trocar.TrocarEnv(**brief, threads=1)
    actions = [actions_of(one, seed, 2) for seed in (20, 21)]
    envs.reset(seed=20)
    hashes = []
    for k, seed in enumerate((20, 21)):
        alone.reset(seed=seed)
        for action in actions[k]:
            alone.step(action)
        hashes.append(alone.state_hash)
    for step in range(2):
        envs.step(np.stack([a[step] for a in actions]))
    assert [cell.state_hash for cell in envs.envs] == hashes
    # The tissue is another one than the tetrahedra.
    alone = trocar.TrocarEnv(**BRIEF, threads=1)
    alone.reset(seed=20)
    for action in actions[0]:
        alone.step(action)
    assert alone.state_hash != hashes[0]


def test_the_other_autoreset_modes(one):
    options = {"num_envs": 2, "task": "grasp-lift", "episode_s": 0.1}
    actions = np.stack([actions_of(one, 3, 1)[0]] * 2)
    same = trocar.TrocarVectorEnv(**options, autoreset_mode="same-step")
    same.reset(seed=4)
    for _ in range(3):
        seen, _, _, late, infos = same.step(actions)
    assert (
        late.all()
        and infos["final_info"]["end"].tolist() == ["time-out"] * 2
        and "end" not in infos
    )
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


def test_gymnasiums_names_of_autoreset_modes():
    for given, mode in [
        ("SameStep", AutoresetMode.SAME_STEP),
        ("next-step", AutoresetMode.NEXT_STEP),
    ]:
        assert (
            trocar.TrocarVectorEnv(1, **BRIEF, autoreset_mode=given).metadata["autoreset_mode"]
            == mode
        )
    with pytest.raises(ValueError, match="autoreset_mode: 'never'"):
        trocar.TrocarVectorEnv(1, **BRIEF, autoreset_mode="never")
    for count in (0, -1, 2.0, 5000):
        with pytest.raises(ValueError, match="num_envs: is"):
            trocar.TrocarVectorEnv(count, **BRIEF)


def test_wrong_masks_and_seeds_reset_nothing(two):
    two.reset(seed=[1, 2])
    hashes = two.get_attr("state_hash")
    for mask in ([True], [True] * 3, np.array([2, 0]), np.array([[True, False]]), "yes"):
        with pytest.raises(ValueError, match="reset_mask: has shape"):
            two.reset(seed=5, options={"reset_mask": mask})
    for seed in (2**63, 10**6, 10**6 - 1, -1, [3, 10**6], [3, -1], [3.5, 1], [1, 2, 3], 1.5):
        with pytest.raises(ValueError, match="seed: "):
            two.reset(seed=seed)
    assert two.get_attr("state_hash") == hashes
    *_, infos = two.step(two.action_space.sample())
    assert infos["seed"].tolist() == [1, 2]
    _, infos = two.reset(seed=[10**6 - 1, None], options={"reset_mask": np.array([True, False])})
    assert infos["seed"].tolist() == [10**6 - 1, 2]


def test_a_restored_cell_continues_past_its_end_as_before(two):
    actions = np.stack([two.single_action_space.low] * 2)

    def follow():
        rows = []
        for _ in range(6):
            seen, rewards, _, late, infos = two.step(actions)
            rows.append(
                (seen[0].tobytes(), rewards[0], late[0], infos["seed"][0], two.envs[0].state_hash)
            )
        return rows

    two.reset(seed=1)
    two.step(actions)
    saved, shown = two.save_state(0), two.step(actions)[0]
    two.reset(seed=1)
    seen, *_ = two.step(actions)
    first = follow()
    assert len({row[3] for row in first}) == 2, "an episode has ended in between"
    assert np.array_equal(two.restore_state(0, saved), seen[0]) and not np.array_equal(
        shown[0], seen[0]
    )
    assert follow() == first
    # After an ended episode, the next step starts a new one.
    two.reset(seed=1)
    for _ in range(3):
        two.step(actions)
    over = two.save_state(0)
    first = follow()
    two.reset(seed=9)
    two.restore_state(0, over)
    assert follow() == first


def test_a_state_moves_between_one_and_many(two, one):
    two.reset(seed=[4, 5])
    two.step(np.stack([two.single_action_space.low] * 2))
    assert np.array_equal(
        one.restore_state(two.save_state(1)), two.restore_state(0, two.save_state(1))
    )
    assert one.step(one.action_space.low)[4]["seed"] == 5
    with pytest.raises(TypeError, match="state: "):
        two.restore_state(0, (None, True))
    for k in (2, -1):
        with pytest.raises(ValueError, match="k: is"):
            two.save_state(k)


def test_a_cell_of_many_has_the_attributes_of_one(two):
    two.reset(seed=[4, 5])
    pictures = two.call("render")
    assert [p.shape for p in pictures] == [(32, 48, 3)] * 2 and np.array_equal(
        pictures[1], two.envs[1].render()
    )
    assert two.get_attr("state_names") == (two.state_names,) * 2
    assert (
        two.call("_max_episode_steps") == (3, 3)
        and two.envs[0].task_description == two.task_description
    )
    assert two.get_attr("privileged_channels")[0].keys() == set(two.channel_names)
    two.set_attr("label", ["a", "b"])
    two.set_attr("mark", 3)
    assert two.get_attr("label") == ("a", "b") and two.get_attr("mark") == (3, 3)
    with pytest.raises(ValueError, match="it must be 2"):
        two.set_attr("label", ["a"])
    view = two.envs[1]
    assert view.unwrapped is view and view.observation_space == two.single_observation_space
    expert = trocar.Policy("scripted")
    expert.reset(two, 1)
    first = expert(two, 1)
    expert.reset(view)
    assert np.array_equal(expert(view), first), "a controller drives the view's own cell"
    view.restore_state(two.envs[0].save_state())
    assert two.envs[0].state_hash == view.state_hash


def test_a_cell_of_many_has_its_spec():
    envs = gym.make_vec("trocar/GraspLift-v0", num_envs=1, episode_s=0.1, variation="none")
    assert envs.envs[0].spec.id == "trocar/GraspLift-v0"


def test_calls_in_the_wrong_order_raise_for_many_cells():
    envs = trocar.TrocarVectorEnv(2, **BRIEF, render_mode="rgb_array")
    actions = np.stack([envs.single_action_space.low] * 2)
    for too_early in (lambda: envs.step(actions), envs.render, lambda: envs.save_state(0)):
        with pytest.raises(ResetNeeded):
            too_early()
    _, info = envs.reset(seed=1, options={"reset_mask": np.array([True, False])})
    assert not info["is_success"].any() and not envs.cells.terminated.any(), (
        "nor has one ended that has not begun"
    )
    with pytest.raises(ResetNeeded, match=r"\[1\]"):
        envs.step(actions)
    envs.reset(seed=1, options={"reset_mask": np.array([False, True])})
    envs.step(actions)
    envs.close()
    envs.close()
    for too_late in (lambda: envs.step(actions), envs.reset, envs.render):
        with pytest.raises(ClosedEnvironmentError):
            too_late()
    assert (
        envs.closed and envs.cells._native is None and envs.get_attr("task") == ("grasp-lift",) * 2
    )


def test_cells_are_freed_with_their_environment():
    envs = trocar.TrocarVectorEnv(1, **BRIEF)
    cells, view = weakref.ref(envs.cells), envs.envs[0]
    del envs
    assert cells() is None, "a view of a cell does not keep the cells"
    with pytest.raises(ClosedEnvironmentError):
        view.task
