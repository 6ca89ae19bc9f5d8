"""Serves a policy by the package `openpi-server`, as from a machine with a GPU.

    pip install openpi-server
    python examples/python/serve_openpi.py --port 8000
    trocar evaluate cell-a --policy sway=ws://127.0.0.1:8000 --episodes 2

`python -m trocar.serve examples/python/serve_openpi.py:Sway` serves the same object without that
package.
"""

import argparse
from typing import Any

import numpy as np

#: Coordinates of an arm in `observation/state`: two pivot angles (rad), insertion (m), roll (rad),
#: jaw opening.
LEFT, RIGHT = slice(0, 5), slice(23, 28)


class Sway:
    """Swings both instruments slowly from side to side about their initial poses."""

    def __init__(self) -> None:
        self.start: np.ndarray | None = None

    def infer(self, obs: dict[str, Any]) -> dict[str, Any]:
        """A chunk of 8 actions (8, 10): absolute targets at 30 a second."""
        state, step = np.asarray(obs["observation/state"]), int(obs["episode/step"])
        if step == 0 or self.start is None:
            self.start = np.concatenate([state[LEFT], state[RIGHT]])
        chunk = np.tile(self.start, (8, 1)).astype(np.float64)
        lean = 0.03 * np.sin(2.0 * np.pi * (step + 1 + np.arange(8)) / 90.0)
        chunk[:, [0, 5]] += lean[:, None]
        return {"actions": chunk}

    def reset(self) -> None:
        """Starts an episode."""
        self.start = None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    options = parser.parse_args()
    from openpi_server import WebsocketPolicyServer

    print(f"ws://{options.host}:{options.port}", flush=True)
    WebsocketPolicyServer(Sway(), host=options.host, port=options.port).serve_forever()


if __name__ == "__main__":
    main()
