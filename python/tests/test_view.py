"""`trocar.view`: an environment in the browser while a program steps it."""

import json
import os
import urllib.error
import urllib.request

import gymnasium as gym
import numpy as np
import pytest
from conftest import SHORT, actions_of, rollout

import trocar

pytestmark = pytest.mark.filterwarnings("ignore:this build of trocar has no page")


def answer(url):
    """The status of the answer to a request."""
    try:
        with urllib.request.urlopen(url, timeout=10) as got:
            return got.status
    except urllib.error.HTTPError as why:
        return why.code


def messages(viewer):
    """A connection to the wire."""
    pytest.importorskip("websockets")
    from trocar.teleop.wire import Wire

    return Wire(viewer.wire)


def wait(wire, kind, wanted=lambda head: True):
    while True:
        message = wire.receive()
        if message.head["type"] == kind and wanted(message.head):
            return message


def test_a_view_changes_no_bit_and_shows_the_last_step(one):
    actions = actions_of(one, 5, 8)
    seen, rewards, hashes = rollout(one, 11, actions)
    with trocar.view(one) as viewer:
        assert viewer.url.startswith("http://127.0.0.1:") and "?token=" in viewer.url
        assert viewer.url in repr(viewer)
        wire = messages(viewer)
        wire.send(type="subscribe", frames_hz=240, value="energy", contacts=True, held=True)
        wire.send(type="reset", seed=1, request=1)
        refused = wait(wire, "error")
        assert "clients watch" in refused.head["message"]
        again, rewards_again, hashes_again = rollout(one, 11, actions)
        last = wait(wire, "frame", lambda head: head["step"] == len(hashes))
        assert last.head["actors"] == {"left": "environment", "right": "environment"}
        status = wait(wire, "status", lambda head: head["time_s"] > 0)
        assert status.head["seed"] == 11 and status.head["policy"] == "environment"
        wire.close()
    np.testing.assert_array_equal(seen, again)
    np.testing.assert_array_equal(rewards, rewards_again)
    assert hashes == hashes_again
    assert viewer.closed and repr(viewer) == "Viewer(closed)"
    with pytest.raises(OSError):
        answer(viewer.url)
    # The environment goes on without it.
    assert rollout(one, 11, actions)[2] == hashes


def test_a_cell_of_many_is_shown_and_restored_states_too():
    envs = gym.make_vec("trocar/GraspLift-v0", num_envs=2, **SHORT)
    envs.reset(seed=3)
    viewer = trocar.view(envs, 1)
    wire = messages(viewer)
    assert json.dumps(wait(wire, "hello").head["source"]).count("cell 1 of 2") == 1
    middle = np.array([0.5 * (s.low + s.high) for s in [envs.single_action_space] * 2])
    saved = envs.save_state(1)
    envs.step(middle)
    assert wait(wire, "frame", lambda head: head["step"] == 1).head["time_s"] > 0
    envs.restore_state(1, saved)
    assert wait(wire, "frame", lambda head: head["step"] == 0).head["time_s"] == 0
    assert wait(wire, "status", lambda head: head["time_s"] == 0).head["seed"] == 4
    # Another cell, through its own view of the environment, at the same time.
    other = trocar.view(envs.envs[0])
    assert other.url != viewer.url
    assert answer(other.url) == 200
    for wrong in [2, -1, "1"]:
        with pytest.raises(ValueError, match="cell: "):
            trocar.view(envs, wrong)
    with pytest.raises(TypeError, match="must be an environment of trocar"):
        trocar.view(gym.make("CartPole-v1"))
    with pytest.raises(ValueError, match="port"):
        trocar.view(envs, port=int(viewer.url.split(":")[2].split("/")[0]))
    # A view ends with its environment.
    envs.close()
    assert viewer.closed and other.closed


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_leaves_the_view_to_its_parent(one):
    one.reset(seed=1)
    with trocar.view(one) as viewer:
        child = os.fork()
        if child == 0:
            viewer.close()
            os._exit(0)
        _, status = os.waitpid(child, 0)
        assert status == 0 and not viewer.closed
        assert answer(viewer.url) == 200
