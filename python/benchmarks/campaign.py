"""Episodes an hour of a campaign by the number of Ray workers, and whether the tables are equal.

    python python/benchmarks/campaign.py --workers 1 2 --episodes 12

It needs `pip install '.[ray]'`, unless `--ray none` runs it on threads.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from trocar import campaign


def measured(
    scene: str, policy: str, episodes: int, workers: int, address: str | None, folder: Path
) -> dict[str, Any]:
    """Runs a new campaign.

    The rate excludes each worker's first episode, in which Ray starts and workers build cells.
    """
    ends: list[float] = []

    def record_time(done: int, _: int) -> None:
        if done:
            ends.append(time.perf_counter())

    start = time.perf_counter()
    result = campaign.run(
        scene,
        [policy],
        folder,
        episodes=episodes,
        variation="none",
        workers=workers,
        ray_address=address,
        progress=record_time,
    )
    wall = time.perf_counter() - start
    rate = 3600.0 * (episodes - workers) / (ends[-1] - ends[workers - 1])
    table = (folder / "table.csv").read_text()
    return {
        "workers": workers,
        "wall_s": wall,
        "first_s": ends[0] - start,
        "episodes_h": rate,
        "hash": result["hash"],
        "table": table,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="cell-a")
    parser.add_argument("--policy", default="scripted")
    parser.add_argument("--episodes", type=int, default=12)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument(
        "--ray",
        default="local",
        metavar="ADDRESS",
        help="auto, local, host:port, or none for threads (default %(default)s)",
    )
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.episodes <= max(options.workers):
        parser.error(f"--episodes {options.episodes}: must be more than --workers")
    address = None if options.ray == "none" else options.ray
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            measured(
                options.scene,
                options.policy,
                options.episodes,
                n,
                address,
                Path(folder) / f"workers-{n}",
            )
            for n in options.workers
        ]
    same = len({(row["hash"], row.pop("table")) for row in rows}) == 1
    if options.json:
        print(json.dumps({"same": same, "rows": rows}))
        return
    print(f"{'workers':>8} {'episodes/h':>11} {'times':>6} {'wall s':>7} {'first after s':>14}")
    for row in rows:
        times = row["episodes_h"] / rows[0]["episodes_h"]
        print(
            f"{row['workers']:>8} {row['episodes_h']:>11.0f} {times:>6.2f} "
            f"{row['wall_s']:>7.1f} {row['first_s']:>14.1f}"
        )
    print("tables and states are equal" if same else "TABLES OR STATES DIFFER")


if __name__ == "__main__":
    main()
