"""The other side of the tests against openpi's own Python code.

python openpi_peer.py pack                    packs the sample with openpi_client.msgpack_numpy, to standard output
python openpi_peer.py serve                   openpi_server's WebsocketPolicyServer on a free port, which it prints
python openpi_peer.py ask URL [KEY]           openpi_client's client asks the server at URL once and prints what it gets, as JSON
"""

import json
import socket
import sys

import numpy as np
from openpi_client import msgpack_numpy


def sample():
    """The observation of the Rust tests; keys in order, as the Rust side writes them."""
    return {
        "images": {"cam_high": np.arange(60, dtype=np.uint8).reshape(4, 5, 3)},
        "observation/state": np.array([0.5, -1.0, 2.25], dtype=np.float32),
        "observation/wrench": np.array([[1e-300], [-0.1]]),
        "prompt": "lift the appendix \u2014 slowly",
        "step": 300,
        "time": 0.25,
        "training": False,
    }


class Policy:
    """Answers with what it was shown, so that the other side can compare."""

    def infer(self, obs):
        if obs["prompt"] == "fail":
            raise ValueError("no such appendix")
        assert obs["images"]["cam_high"].shape == (4, 5, 3), obs["images"]["cam_high"].shape
        assert obs["images"]["cam_high"].dtype == np.uint8
        state = np.asarray(obs["observation/state"])
        actions = np.stack([state * k for k in range(1, 11)]).astype(np.float32)
        same = msgpack_numpy.packb(obs) == msgpack_numpy.packb(sample())
        return {"actions": actions, "same": same, "pixels": np.int64(obs["images"]["cam_high"].sum()),
                "wrench": np.asfortranarray(obs["observation/wrench"]), "gain": np.float32(0.5)}

    def reset(self):
        pass


def serve():
    from openpi_server import WebsocketPolicyServer

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    print(port, flush=True)
    metadata = {"name": "oracle", "horizon": np.int32(10), "mean": np.zeros((2, 3)), "nested": {"list": [1, 2.5, None]}}
    WebsocketPolicyServer(Policy(), host="127.0.0.1", port=port, metadata=metadata).serve_forever()


def ask(url, key=None):
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    client = WebsocketClientPolicy(url, api_key=key)
    reply = client.infer(sample())
    actions = reply["actions"]
    print(json.dumps({"metadata": client.get_server_metadata(), "actions": actions.tolist(), "dtype": actions.dtype.str,
                      "timed": reply["server_timing"]["infer_ms"] >= 0}))


if __name__ == "__main__":
    if sys.argv[1] == "pack":
        sys.stdout.buffer.write(msgpack_numpy.packb(sample()))
    elif sys.argv[1] == "serve":
        serve()
    else:
        ask(*sys.argv[2:])
