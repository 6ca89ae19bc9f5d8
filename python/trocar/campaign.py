r"""Campaigns of policies, on this machine or on a Ray cluster, as `trocar evaluate` runs them.

    python -m trocar.campaign SCENE --policy scripted --policy mine=ws://gpu:8000 \
        --episodes 100 -o campaign --ray auto

The plan, folder, table and report are those of `trocar evaluate`. An episode's bits depend on
scene, specimen, policy and seed only: `hash` in `result.json` is the same for any number of workers
on any number of machines. Each worker builds its own cell (about a second) and runs one episode
after the other on one CPU. An episode whose worker is lost runs again on another worker. Finished
episodes are kept one by one. It is safe to stop at any time, by Ctrl-C too: the same command
resumes.

On Ray, a scene file and a policy's module must have the same path on every machine. Ray needs
`pip install '.[ray]'`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ._loading import check_python_policies
from ._native import Campaign, cameras
from ._progress import Bar
from ._ray import run_on_ray
from ._signals import ignore_interrupts
from ._threads import run_on_threads
from .envs.cells import phantoms_folder

#: Called with the numbers of finished and of missing episodes: before the first and after each.
Progress = Callable[[int, int], None]


def run(
    scene: str,
    policies: Sequence[str],
    output: str | os.PathLike[str],
    *,
    episodes: int = 15,
    seed: int = 0,
    split: str = "seen",
    variation: str | None = None,
    by: Sequence[str] = (),
    backend: str | None = None,
    workers: int | None = None,
    ray_address: str | None = None,
    retry_failed: bool = False,
    surfaces: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Runs the missing episodes of the campaign in `output` and returns its `result.json`.

    - `split`, `variation`, `by`: as `--split`, `--variation` and `--by` of `trocar evaluate`.
    - `backend`: the model of the tissue, `tetrahedra` or `lattice` (default: the scene's).
    - `ray_address`: `auto` for a running cluster, `local` for a new one on this machine,
      `host:port`; None runs without Ray.
    - `workers`: episodes at once (default: one a CPU).
    - `retry_failed`: episodes whose policy failed run again.
    - `surfaces`: keeps what pictures are made of, for `trocar.export`.

    `$TROCAR_PYTHON`, or else this interpreter, serves `python:...` policies. They are loaded before
    anything is built.

    Ctrl-C stops it within moments: KeyboardInterrupt, with the finished episodes kept and in table
    and report. ValueError for a scene, policy or folder that cannot be used. On Ray, RuntimeError
    for an error in a worker. A campaign that fails before its first episode leaves no folder.
    """
    output = Path(output)
    # Raises for a scene that cannot be read.
    cameras(scene)
    if ray_address in (None, "local"):
        # Other machines may have what this one lacks. There the first worker checks.
        check_python_policies(policies, output, episodes, retry_failed=retry_failed)
    folder = phantoms_folder()
    folder.mkdir(parents=True, exist_ok=True)
    is_new = not output.exists()
    campaign = Campaign(
        scene,
        list(policies),
        episodes,
        seed,
        folder,
        output,
        split=split,
        variation=variation,
        by=list(by),
        backend=backend,
    )
    progress = progress or (lambda done, missing: None)
    try:
        jobs = campaign.missing(retry_failed)
        if jobs and ray_address is None:
            run_on_threads(campaign, scene, jobs, workers, progress, surfaces=surfaces)
        elif jobs and ray_address is not None:
            run_on_ray(campaign, scene, jobs, workers, ray_address, progress, surfaces=surfaces)
        result: dict[str, Any] = json.loads(campaign.finish())
    except KeyboardInterrupt:
        # Videos take long; the next run makes them.
        with ignore_interrupts():
            campaign.finish(films=False)
        raise
    except Exception:
        if is_new and not any(output.glob("episodes/*/*/result.json")):
            # The campaign holds the folder's lock.
            del campaign
            shutil.rmtree(output, ignore_errors=True)
        raise
    return result


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m trocar.campaign",
        description="Campaigns of policies, on this machine or on a Ray cluster.",
    )
    parser.add_argument("scene", help="scene file, or a built-in scene such as cell-a")
    parser.add_argument(
        "--policy",
        action="append",
        metavar="POLICY",
        help="as in trocar evaluate; may be given again (default scripted)",
    )
    parser.add_argument(
        "--episodes", type=int, default=15, help="episodes of each policy (default %(default)s)"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="number of the first episode in the split (default %(default)s)",
    )
    parser.add_argument(
        "--split",
        choices=["seen", "unseen", "both"],
        default="seen",
        help="episodes to train on, episodes kept apart, or both (default %(default)s)",
    )
    parser.add_argument(
        "--variation",
        choices=["none", "easy", "standard", "hard"],
        help="what varies (default: the set of the scene, or standard if it has none)",
    )
    parser.add_argument(
        "--by",
        type=lambda names: names.split(","),
        default=[],
        metavar="NAMES",
        help="show success by these, as in trocar evaluate (default: all that varies)",
    )
    parser.add_argument(
        "--backend",
        choices=["tetrahedra", "lattice"],
        help="the model of the tissue (default: the scene's)",
    )
    parser.add_argument("--workers", type=int, help="episodes at once (default: one a CPU)")
    parser.add_argument(
        "--retry-failed", action="store_true", help="run episodes again whose policy failed"
    )
    parser.add_argument(
        "--surfaces", action="store_true", help="keep what `trocar export` makes pictures of"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--ray", metavar="ADDRESS", help="run on a Ray cluster: auto, local, or host:port"
    )
    where.add_argument(
        "--local", action="store_true", help="run on this machine without Ray (the default)"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("trocar-campaign"),
        help="campaign folder (default %(default)s)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    if options.workers is not None and options.workers < 1:
        parser.error(f"--workers {options.workers}: must be at least 1")
    if options.seed < 0:
        parser.error(f"--seed {options.seed}: must not be negative")
    if options.episodes < 1:
        parser.error(f"--episodes {options.episodes}: must be at least 1")

    bar = Bar()

    def show(done: int, missing: int) -> None:
        bar(done, missing)
        if done == missing:
            bar.print("writing the report, with videos of the first failures")

    try:
        result = run(
            options.scene,
            options.policy or ["scripted"],
            options.output,
            episodes=options.episodes,
            seed=options.seed,
            split=options.split,
            variation=options.variation,
            by=options.by,
            backend=options.backend,
            workers=options.workers,
            ray_address=options.ray,
            retry_failed=options.retry_failed,
            surfaces=options.surfaces,
            progress=show,
        )
    except (ValueError, OSError, RuntimeError, ImportError) as why:
        bar.print(f"error: {why}")
        return 1
    except KeyboardInterrupt:
        if (options.output / "result.json").exists():
            bar.print(
                "interrupted; finished episodes are kept, with their table and report; "
                "run the same command to resume"
            )
        else:
            bar.print("interrupted; no episode was started")
        return 130
    if options.json:
        print(json.dumps(result))
    else:
        for row in result["policies"]:
            passed = f"{row['passed']} of {row['episodes']} passed"
            print(f"{row['policy']}: {passed}, mean score {row['mean_score']:.2f}")
            if row["policy_error"]:
                failed = row["ends"]["policy-error"]
                print(
                    f"{row['policy']}: the policy failed in {failed} of {row['episodes']}, "
                    f"first: {row['policy_error']}; --retry-failed runs them again"
                )
        if (distinct := result["distinct_outcomes"]) < result["episodes"]:
            print(
                f"warning: only {distinct} of {result['episodes']} episodes differ from each other"
            )
        print(f"states {result['hash']}\nreport {result['report']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
