"""Steps a second of one cell and of many in one process.

    python python/benchmarks/vector.py [--cells 1 16 64] [--obs state] [--backend lattice]
        [--steps 60] [--json]

Figures are per second and per CPU second, because machines are shared. The ratio of many cells to
one by CPU time is the cost or gain of one process for many cells. Every cell takes the same steps.
"""

import argparse
import json
import time
from typing import Any

import gymnasium as gym
import numpy as np

import trocar  # noqa: F401  (registers the environments)


def measured(
    cells: int, obs: str, backend: str | None, steps: int, threads: int
) -> dict[str, float]:
    """Steps `cells` cells with the same small random motions."""
    name = "trocar/GraspLift-v0"
    options: dict[str, Any] = {"obs": obs, "threads": threads, "normalize": True, "actions": "tip"}
    options |= {"variation": "none", "backend": backend}
    start = time.process_time()
    envs = gym.make_vec(
        name, num_envs=cells, vectorization_mode="vector_entry_point", copy=False, **options
    )
    built = time.process_time() - start
    envs.reset(seed=0)
    rng = np.random.default_rng(1)
    actions = rng.uniform(-0.2, 0.2, (8, *(envs.action_space.shape or ()))).astype(np.float32)
    envs.step(actions[0])
    wall, cpu = time.perf_counter(), time.process_time()
    for k in range(steps):
        envs.step(actions[k % 8])
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    envs.close()
    done = cells * steps
    return {
        "cells": cells,
        "steps_s": done / wall,
        "steps_cpu_s": done / cpu,
        "cores": cpu / wall,
        "build_cpu_s": built / cells,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[1, 16, 64])
    parser.add_argument("--obs", default="state", help="what is observed, such as state+rgb")
    parser.add_argument("--backend", help="tetrahedra or lattice (default: the scene's)")
    parser.add_argument("--steps", type=int, default=60, help="steps of each cell")
    parser.add_argument("--threads", type=int, default=0, help="0 for as many as there are cores")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = [
        measured(n, options.obs, options.backend, options.steps, options.threads)
        for n in options.cells
    ]
    if options.json:
        print(json.dumps(rows))
        return
    print(
        f"obs={options.obs}: steps of 1/30 s; ratio is per CPU second, to {rows[0]['cells']} cell"
    )
    print(
        f"{'cells':>6} {'steps/s':>9} {'steps/CPU s':>12} {'ratio':>6} {'cores':>6} "
        f"{'build CPU s a cell':>19}"
    )
    for row in rows:
        ratio = row["steps_cpu_s"] / rows[0]["steps_cpu_s"]
        print(
            f"{row['cells']:>6} {row['steps_s']:>9.1f} {row['steps_cpu_s']:>12.1f} "
            f"{ratio:>6.2f} {row['cores']:>6.2f} {row['build_cpu_s']:>19.2f}"
        )


if __name__ == "__main__":
    main()
