"""Policies: the program's own from Python, Python's own from the program."""

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import trocar

msgpack = pytest.importorskip("msgpack")
websockets = pytest.importorskip("websockets")

from trocar import serve

STILL = """
import os
import time
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

def reads(obs):
    raise RuntimeError("asked to " + obs["prompt"])

def sleeps(obs):
    with open("served.partial", "w") as file:
        file.write(str(os.getpid()))
    os.rename("served.partial", "served")
    time.sleep(600)
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


def steps(file):
    """Actions and state hashes of an episode file (docs/guides/tasks.md)."""
    _, _, body = file.read_bytes().partition(b"\n")
    kind = np.dtype([("space", "u1"), ("action", "<f8", 10), ("hash", "<u8")])
    return np.frombuffer(body[:-8], kind)


@pytest.mark.parametrize("command", ["episode", "evaluate"])
def test_the_scripted_controller_is_the_programs_bit_for_bit(program, lift_scene, tmp_path, command):
    out, phantoms = tmp_path / "out", trocar.envs.cells.phantoms_folder()
    words = {"episode": ["--policy", "scripted"], "evaluate": ["--policy", "scripted", "--episodes", "1"]}[command]
    called = [program, "--quiet", command, lift_scene, *words, "--seed", 11, "-o", out, "--phantoms", phantoms]
    subprocess.run(list(map(str, called)), check=True, capture_output=True)
    told = steps(next(out.rglob("episode.trocar")))
    env = trocar.TrocarEnv(scene=str(lift_scene), threads=2)
    expert = trocar.Policy("scripted")
    env.reset(seed=11)
    expert.reset(env)
    for k, step in enumerate(told):
        action = expert(env)
        assert np.array_equal(action, step["action"]), f"action {k}"
        *_, ended, late, info = env.step(action)
        assert env.state_hash == step["hash"], f"state {k}"
        assert (ended or late) == (k == len(told) - 1)
    assert info["is_success"] and len(told) > 100


def command_of(program, scene, tmp_path, policies):
    """`trocar evaluate` of Python policies with what it is started with."""
    (tmp_path / "mine.py").write_text(STILL)
    named = [word for policy in policies for word in ("--policy", policy)]
    command = [program, "--quiet", "--json", "evaluate", scene, *named, "--episodes", "2", "-o", tmp_path / "out"]
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    phantoms = trocar.envs.cells.phantoms_folder()
    environment = os.environ | {"TROCAR_PYTHON": sys.executable, "PYTHONPATH": paths}
    return {"args": [*map(str, command), "--phantoms", str(phantoms)], "env": environment, "cwd": tmp_path}


def evaluated(program, scene, tmp_path, policies):
    done = subprocess.run(**command_of(program, scene, tmp_path, policies), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def runs(process):
    """Whether the process of that number runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_a_served_policy_ends_when_the_program_is_killed(program, short_scene, tmp_path):
    served = tmp_path / "served"
    command = command_of(program, short_scene, tmp_path, ["sleeps=python:mine:sleeps"])
    started = subprocess.Popen(**command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until(served.exists, 60)
        assert runs(served.read_text())
    finally:
        started.kill()
        started.wait()
    until(lambda: not runs(served.read_text()), 10)


@pytest.mark.skipif(sys.platform != "linux", reason="a shell closes the input")
def test_a_server_whose_input_is_closed_ends(tmp_path):
    (tmp_path / "mine.py").write_text("def still(obs):\n    return [0.0] * 10\n")
    served = [sys.executable, "-m", "trocar.serve", "mine:still", "--port", "0", "--until-eof"]
    done = subprocess.run(["sh", "-c", 'exec "$@" <&-', "sh", *served], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "Exception" not in done.stderr, done.stderr


def until(true, seconds):
    """Waits for something to be true."""
    begun = time.monotonic()
    while not true():
        assert time.monotonic() - begun < seconds, "it did not come true"
        time.sleep(0.05)


def test_the_program_evaluates_a_python_policy_and_outlives_one_that_raises(program, short_scene, tmp_path):
    result = evaluated(program, short_scene, tmp_path, ["still=python:mine:Still", "raises=python:mine:raises", "reads=python:mine:reads"])
    still, raises, reads = result["policies"]
    assert (still["episodes"], still["ends"]["policy-error"]) == (2, 0), still
    assert (raises["episodes"], raises["ends"]["policy-error"]) == (2, 2), raises
    for episode in range(2):
        kept = json.loads((tmp_path / f"out/episodes/raises/{episode:06}/result.json").read_text())
        assert "RuntimeError: no idea what to do" in kept["end"]["why"], kept["end"]
    assert reads["ends"]["policy-error"] == 2
    kept = json.loads((tmp_path / "out/episodes/reads/000000/result.json").read_text())
    asked = trocar.TrocarEnv(scene=str(short_scene)).task_description
    assert f"asked to {asked}" in kept["end"]["why"], "a served policy and an environment are told the same"


@pytest.mark.parametrize("beside", [[], ["slow=python:mortal.py:slow"]])
def test_a_policy_whose_process_ends_after_an_episode_is_served_anew(program, short_scene, tmp_path, beside):
    """Before the next episode's first question, or amid it; beside another policy's episode the connection is seen to be dead before."""
    (tmp_path / "mortal.py").write_text(
        "import os, threading, time\nimport numpy as np\n"
        "def still(obs):\n    s = obs['observation/state']\n    return {'actions': np.tile([*s[:5], *s[23:28]], (8, 1))}\n"
        "def act(obs):\n    if obs['episode/step'] >= 8:\n        threading.Timer(0.05, os._exit, [3]).start()\n    return still(obs)\n"
        "def slow(obs):\n    time.sleep(1.0)\n    return still(obs)\n"
    )
    command = command_of(program, short_scene, tmp_path, ["mortal=python:mortal.py:act", *beside])
    done = subprocess.run(**command | {"args": [*command["args"], "--jobs", "1"]}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [row["ends"]["policy-error"] for row in json.loads(done.stdout)["policies"]] == [0] * (1 + len(beside)), done.stdout


@pytest.mark.parametrize("policy, said", [
    ("nothing.here:Policy", "No module named 'nothing'"),
    ("nothing.py:Policy", "FileNotFoundError: there is no file"),
    ("os:nothing", "there is no nothing in os"),
    ("os", "FILE.py:NAME or MODULE:NAME"),
])
def test_a_policy_that_cannot_be_imported_is_one_line(policy, said):
    done = subprocess.run([sys.executable, "-m", "trocar.serve", policy, "--port", "0"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and not done.stdout
    assert said in done.stderr.strip().splitlines()[-1]


def test_a_file_is_a_policy_by_its_path(tmp_path, monkeypatch):
    """It finds what lies beside it, may be called like a module that is there, and a module is found as before."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in ("json", "by_path"):
        (tmp_path / f"{name}.py").write_text("import beside\nclass Acts:\n    class Inner:\n        def infer(self, obs):\n            return beside.ACTION\n")
    (tmp_path / "beside.py").write_text("ACTION = [1.0, 2.0]\n")
    for source in (f"{tmp_path}/json.py:Acts.Inner", f"{tmp_path}/by_path.py:Acts.Inner", "by_path:Acts.Inner"):
        assert serve.load(source).infer({})["actions"].tolist() == [[1.0, 2.0]], source
    monkeypatch.chdir(tmp_path)
    assert serve.load("by_path.py:Acts.Inner").infer({})["actions"].shape == (1, 2)
    assert sys.modules["json"] is json


@pytest.mark.parametrize("policy, said", [("python:mine.py:nothing", "no nothing in mine.py"), ("python:other.py:Still", "loaded: FileNotFoundError: ")])
def test_the_program_stops_at_a_policy_that_cannot_be_loaded(program, short_scene, tmp_path, policy, said):
    command = command_of(program, short_scene, tmp_path, ["random", policy])
    command["args"] += ["--jobs", "1"]
    done = subprocess.run(**command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and not list((tmp_path / "out/episodes").rglob("result.json"))
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith(f"error: {policy}: cannot be loaded: ") and said in line


def test_the_program_serves_a_file(program, short_scene, tmp_path):
    (still,) = evaluated(program, short_scene, tmp_path, [f"still=python:{tmp_path}/mine.py:Still"])["policies"]
    assert (still["episodes"], still["ends"]["policy-error"]) == (2, 0), still
