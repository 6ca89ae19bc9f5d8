"""Campaigns of policies, on this machine or on many by Ray: the plan, folder, table and report of `trocar evaluate`.

    python -m trocar.campaign SCENE --policy scripted --policy mine=ws://gpu:8000 --episodes 100 -o campaign --ray auto

An episode's bits depend on scene, specimen, policy and seed alone, so it does not matter who runs it: `hash` in `result.json` is the
same however many workers there were, and whether they were on one machine or on many. Each worker builds its own cell (about a
second) and runs one episode after the other on one CPU. A worker that is lost has its episode run again elsewhere. Finished episodes
are kept one by one; the same command goes on where it was stopped, be it by Ctrl-C.

With Ray, a scene file and a policy's module must be found under the same names on every machine. It needs `pip install .[ray]`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any, Callable, Sequence

from ._native import Campaign
from ._progress import Bar
from ._ray import run_on_ray
from ._signals import deaf
from ._threads import run_on_threads
from .envs.cells import phantoms_folder

#: Called with how many episodes are done and how many were missing: before the first one, and after each.
Progress = Callable[[int, int], None]


def run(
    scene: str,
    policies: Sequence[str],
    output: str | os.PathLike[str],
    *,
    episodes: int = 15,
    seed: int = 0,
    workers: int | None = None,
    ray_address: str | None = None,
    retry_failed: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Runs what is missing of the campaign in `output` and gives what `result.json` says.

    `ray_address`: `auto` for a cluster that runs, `local` for a new one on this machine, `host:port`; None does without Ray.
    `workers`: as many as there are CPUs if not given. Policies `python:...` are served by the interpreter that runs this, unless
    `$TROCAR_PYTHON` names another.

    Ctrl-C ends it within moments, whatever is waited for: `KeyboardInterrupt`, with the finished episodes kept and in table and report. ValueError for a
    scene, policy or folder that cannot be used; on Ray, RuntimeError says what went wrong in a worker.
    """
    folder = phantoms_folder()
    folder.mkdir(parents=True, exist_ok=True)
    campaign = Campaign(scene, list(policies), episodes, seed, folder, Path(output))
    jobs = campaign.missing(retry_failed)
    progress = progress or (lambda done, all: None)
    try:
        if jobs and ray_address is None:
            run_on_threads(campaign, scene, jobs, workers, progress)
        elif jobs:
            run_on_ray(campaign, scene, jobs, workers, ray_address, progress)
        return json.loads(campaign.finish())
    except KeyboardInterrupt:
        # Films take long; the next time will have them.
        with deaf():
            campaign.finish(films=False)
        raise


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m trocar.campaign", description=__doc__.splitlines()[0])
    parser.add_argument("scene", help="scene file, or a built-in scene such as cell-a")
    parser.add_argument("--policy", action="append", metavar="POLICY", help="as in trocar evaluate; may be given again (default scripted)")
    parser.add_argument("--episodes", type=int, default=15, help="episodes of each policy (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first episode (default %(default)s)")
    parser.add_argument("--workers", type=int, help="episodes at once (default: one a CPU)")
    parser.add_argument("--retry-failed", action="store_true", help="do episodes again whose policy failed")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--ray", metavar="ADDRESS", help="run on a Ray cluster: auto, local, or host:port")
    where.add_argument("--local", action="store_true", help="run on this machine without Ray (the default)")
    parser.add_argument("-o", "--output", type=Path, default=Path("trocar-campaign"), help="campaign folder (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    if options.workers is not None and options.workers < 1:
        parser.error(f"--workers {options.workers}: at least 1 is needed")
    if options.seed < 0 or options.episodes < 1:
        parser.error("--seed and --episodes must not be negative, and an episode is needed")

    bar = Bar()

    def tell(done: int, missing: int) -> None:
        bar(done, missing)
        if done == missing:
            bar.say("writing the report, with moving pictures of the first failures")

    try:
        result = run(
            options.scene,
            options.policy or ["scripted"],
            options.output,
            episodes=options.episodes,
            seed=options.seed,
            workers=options.workers,
            ray_address=options.ray,
            retry_failed=options.retry_failed,
            progress=tell,
        )
    except (ValueError, OSError, RuntimeError, ImportError) as why:
        bar.say(f"error: {why}")
        return 1
    except KeyboardInterrupt:
        kept = (options.output / "result.json").exists()
        bar.say("interrupted; " + ("finished episodes are kept, with their table and report, and the same command goes on" if kept else "no episode was begun"))
        return 130
    if options.json:
        print(json.dumps(result))
    else:
        for row in result["policies"]:
            print(f"{row['policy']}: {row['passed']} of {row['episodes']} passed, mean score {row['mean_score']:.2f}")
            if row["policy_error"]:
                print(f"{row['policy']} failed in {row['ends']['policy-error']} episodes, first: {row['policy_error']}; --retry-failed does them again")
        print(f"states {result['hash']}\nreport {result['report']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
