"""Pictures of the cameras: their spaces, the same bits for one cell and many, noise by the seed."""

import numpy as np
import pytest
from conftest import SHORT
from gymnasium.utils.env_checker import check_env

import trocar


def test_pictures_pass_gymnasiums_checker(seeing):
    check_env(seeing.unwrapped, skip_render_check=True, skip_close_check=True)
    space = seeing.observation_space
    assert set(space) == {"agent_pos", "pixels", "depth"} and set(space["pixels"]) == {
        "endoscope",
        "d405",
    }
    assert (
        space["pixels"]["d405"].shape == (48, 64, 3) and space["pixels"]["d405"].dtype == np.uint8
    )
    assert (
        space["depth"]["endoscope"].shape == (48, 64, 1)
        and space["depth"]["endoscope"].dtype == np.float32
    )


def test_colours_alone_pass_gymnasiums_checker():
    env = trocar.TrocarEnv(task="grasp-lift", obs="rgb", image_size=(16, 24), **SHORT)
    check_env(env, skip_render_check=True, skip_close_check=True)
    assert set(env.observation_space) == {"pixels"} and env.observation_space["pixels"][
        "d405"
    ].shape == (16, 24, 3)
    seen, _ = env.reset(seed=1)
    assert set(seen) == {"pixels"} and env.observation_space.contains(seen)


def test_pictures_show_the_cell(seeing):
    seen, _ = seeing.reset(seed=1)
    for camera in ("endoscope", "d405"):
        assert seen["pixels"][camera].std() > 10, f"{camera} sees something"
    # The depth camera is 0.29 m above the ports, the specimen below them.
    depth = seen["depth"]["d405"]
    assert 0.2 < np.median(depth[depth > 0]) < 0.6
    shown = seeing.render()
    assert shown.shape == (48, 64, 3) and np.array_equal(shown, seen["pixels"]["endoscope"])
    kept = seen["pixels"]["endoscope"].copy()
    action = seeing.action_space.high.copy()
    for _ in range(6):
        after, *_ = seeing.step(action)
    assert np.array_equal(kept, seen["pixels"]["endoscope"]), "what was seen stays as it was"
    assert (after["pixels"]["endoscope"] != kept).any(), "the instruments have moved"
    again, _ = seeing.reset(seed=1)
    assert np.array_equal(again["pixels"]["endoscope"], kept) and np.array_equal(
        again["depth"]["d405"], depth
    )


def test_many_cells_render_the_pictures_of_one_and_noise_follows_the_seed(seeing):
    options = {"obs": "rgb+depth", "image_size": (48, 64), "cameras": ["d405"], "copy": False}
    envs = trocar.TrocarVectorEnv(2, task="grasp-lift", **SHORT, **options)
    assert set(envs.single_observation_space) == {"pixels", "depth"}
    seen, _ = envs.reset(seed=[4, 9])
    actions = np.stack([seeing.action_space.low] * 2)
    now, *_ = envs.step(actions)
    assert now["pixels"]["d405"] is seen["pixels"]["d405"], "the arrays are written in place"
    for k, seed in enumerate((4, 9)):
        seeing.reset(seed=seed)
        alone, *_ = seeing.step(actions[k])
        assert np.array_equal(now["pixels"]["d405"][k], alone["pixels"]["d405"])
        assert np.array_equal(now["depth"]["d405"][k], alone["depth"]["d405"])
    noisy = trocar.TrocarEnv(
        task="grasp-lift",
        obs="rgb+depth",
        cameras="d405",
        image_size=(48, 64),
        sensor_noise=True,
        **SHORT,
    )
    first, _ = noisy.reset(seed=4)
    again, _ = noisy.reset(seed=4)
    clean, _ = seeing.reset(seed=4)
    other = noisy.cells.native.picture(0, "d405", 48, 64)
    assert np.array_equal(first["pixels"]["d405"], again["pixels"]["d405"]) and np.array_equal(
        other, first["pixels"]["d405"]
    )
    assert not np.array_equal(first["pixels"]["d405"], clean["pixels"]["d405"])
    spread = np.abs(first["depth"]["d405"] - clean["depth"]["d405"])[first["depth"]["d405"] > 0]
    assert 0 < np.median(spread) < 5e-3


def test_wrong_cameras_are_named():
    for options, words in [
        ({"cameras": ["keyhole"]}, "keyhole.*endoscope"),
        ({"cameras": []}, "rgb needs one"),
        ({"image_size": (4, 64)}, "image_size"),
        ({"render_mode": "human"}, "rgb_array"),
    ]:
        with pytest.raises(ValueError, match=words):
            trocar.TrocarEnv(task="port-reach", obs="rgb", **options)
