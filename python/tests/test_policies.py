"""Policies: the program's own from Python, Python's own from the program."""

import json
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
import trocar

msgpack = pytest.importorskip("msgpack")
websockets = pytest.importorskip("websockets")

from trocar import serve

STILL = """
import numpy as np

class Still:
    resets = 0
    def infer(self, obs):
        assert obs["observation/images/endoscope"].dtype == np.uint8, obs.keys()
        state = obs["observation/state"]
        print("a policy may print")
        return {"actions": np.tile(np.r_[state[:5], state[23:28]], (8, 1))}

def raises(obs):
    if obs["episode/step"] > 0:
        raise RuntimeError("no idea what to do")
    state = obs["observation/state"]
    return np.r_[state[:5], state[23:28]]
"""


def test_the_scripted_controller_acts_on_an_environment(one):
    expert = trocar.Policy("scripted")
    hashes = []
    for _ in range(2):
        one.reset(seed=3)
        expert.reset(one)
        for _ in range(10):
            one.step(expert(one))
        hashes.append(one.unwrapped.state_hash)
    assert hashes[0] == hashes[1]
    assert "scripted" in trocar.policies() and "random" in trocar.policies()
    with pytest.raises(ValueError, match="scripted"):
        trocar.Policy("genius")


def test_messages_come_back_and_nothing_is_unpickled():
    sent = {"a": np.arange(6, dtype="<f4").reshape(2, 3), "n": np.int64(3), "b": [True, None, "text", b"bytes"]}
    got = serve.unpack(serve.pack(sent))
    assert np.array_equal(got["a"], sent["a"]) and got["a"].dtype == np.float32 and got["n"] == 3 and got["b"] == sent["b"]
    bad = [
        {b"__ndarray__": True, b"data": b"x", b"dtype": "|O", b"shape": [1]},
        {b"__ndarray__": True, b"data": b"x", b"dtype": "<f8", b"shape": [1]},
        {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "<f8", b"shape": [-1]},
        {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "nonsense", b"shape": [1]},
    ]
    for message in [*map(msgpack.packb, bad), b"\xc1", b""]:
        with pytest.raises(ValueError):
            serve.unpack(message)


def test_a_server_answers_resets_and_tells_errors():
    from websockets.sync.client import connect

    class Policy:
        resets = 0

        def infer(self, obs):
            if "bad" in obs:
                raise KeyError("bad")
            return {"actions": np.full(10, obs["x"])}

        def reset(self):
            self.resets += 1

    address, ready, policy = [], threading.Event(), Policy()
    tell = lambda url: (address.append(url), ready.set())
    threading.Thread(target=serve.serve, args=(serve.Served(policy),), kwargs={"told": tell}, daemon=True).start()
    assert ready.wait(10) and address[0].startswith("ws://127.0.0.1:")
    with connect(address[0]) as client:
        assert serve.unpack(client.recv())["server"] == "trocar.serve"
        client.send(serve.pack({"x": 2.0, "episode/step": 0}))
        reply = serve.unpack(client.recv())
        assert reply["actions"].shape == (1, 10) and reply["server_timing"]["infer_ms"] >= 0 and policy.resets == 1
        client.send(serve.pack({"endpoint": "reset"}))
        assert client.recv() == "reset successful" and policy.resets == 2
        client.send(serve.pack({"bad": 1}))
        assert client.recv().strip().splitlines()[-1] == "KeyError: 'bad'"


def evaluated(program, scene, tmp_path, policies):
    (tmp_path / "mine.py").write_text(STILL)
    named = [word for policy in policies for word in ("--policy", policy)]
    command = [program, "--quiet", "--json", "evaluate", scene, *named, "--episodes", "2", "-o", tmp_path / "out"]
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    phantoms = trocar.envs.cells.phantoms_folder()
    environment = os.environ | {"TROCAR_PYTHON": sys.executable, "PYTHONPATH": paths}
    done = subprocess.run([*map(str, command), "--phantoms", str(phantoms)], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_program_evaluates_a_python_policy_and_outlives_one_that_raises(program, short_scene, tmp_path):
    result = evaluated(program, short_scene, tmp_path, ["still=python:mine:Still", "raises=python:mine:raises"])
    still, raises = result["policies"]
    assert (still["episodes"], still["ends"][4]) == (2, 0), still
    assert (raises["episodes"], raises["ends"][4]) == (2, 2), raises
    for episode in range(2):
        kept = json.loads((tmp_path / f"out/episodes/raises/{episode:06}/result.json").read_text())
        assert "RuntimeError: no idea what to do" in kept["end"]["why"], kept["end"]


def test_a_policy_that_cannot_be_imported_is_one_line(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "trocar.serve", "nothing.here:Policy", "--port", "0"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1 and not done.stdout
    assert "No module named 'nothing'" in done.stderr.strip().splitlines()[-1]
