"""Campaigns of policies, on this machine or on many by Ray: the plan, folder, table and report of `trocar evaluate`.

    python -m trocar.campaign SCENE --policy scripted --policy mine=ws://gpu:8000 --episodes 100 -o campaign --ray auto

An episode's bits depend on scene, specimen, policy and seed alone, so it does not matter who runs it: `hash` in `result.json` is the
same however many workers there were, and whether they were on one machine or on many. Each worker builds its own cell (about a
second) and runs one episode after the other on one CPU. A worker that is lost has its episode run again elsewhere. Finished episodes
are kept one by one; the same command goes on where it was stopped.

With Ray, a scene file and a policy's module must be found under the same names on every machine. It needs `pip install .[ray]`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Callable, Sequence

from ._native import Campaign, Worker
from .envs.cells import phantoms_folder

#: How often a job is tried whose workers are lost.
TRIES = 3

#: Called after each episode with how many are done and how many were missing.
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
    `workers`: as many as there are CPUs if not given.
    """
    _own_interpreter()
    folder = phantoms_folder()
    folder.mkdir(parents=True, exist_ok=True)
    campaign = Campaign(scene, list(policies), episodes, seed, folder, Path(output))
    jobs = campaign.missing(retry_failed)
    progress = progress or (lambda done, all: None)
    if jobs:
        if ray_address is None:
            _on_threads(campaign, scene, jobs, workers, progress)
        else:
            _on_ray(campaign, scene, jobs, workers, ray_address, progress)
    return json.loads(campaign.finish())


def _own_interpreter() -> None:
    """Policies `python:MODULE:NAME` are served by the interpreter that runs this, which has `trocar`, unless another is named."""
    if sys.executable:
        os.environ.setdefault("TROCAR_PYTHON", sys.executable)


def _on_threads(campaign: Campaign, scene: str, jobs: list[str], workers: int | None, progress: Progress) -> None:
    """Native code holds no interpreter's lock, so threads are enough."""
    count = min(workers or os.cpu_count() or 1, len(jobs))
    idle = [Worker(scene, phantoms_folder(), campaign.plan) for _ in range(count)]
    waiting, done = jobs[::-1], 0
    with ThreadPoolExecutor(count) as pool:
        under_way: dict[Future[Any], tuple[str, Worker]] = {}
        try:
            while waiting or under_way:
                while idle and waiting:
                    worker, job = idle.pop(), waiting.pop()
                    under_way[pool.submit(worker.run, job)] = (job, worker)
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    job, worker = under_way.pop(future)
                    campaign.put(job, future.result())
                    idle.append(worker)
                    done += 1
                    progress(done, len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _on_ray(
    campaign: Campaign, scene: str, jobs: list[str], workers: int | None, address: str, progress: Progress
) -> None:
    try:
        import ray
    except ImportError as why:
        raise ModuleNotFoundError("ray is not installed; pip install trocar[ray], or leave --ray out") from why
    begun = not ray.is_initialized()
    if begun:
        options: dict[str, Any] = {} if address != "local" else {"num_cpus": workers or os.cpu_count()}
        ray.init(address=address, log_to_driver=False, include_dashboard=False if address == "local" else None, **options)
    try:
        actor = ray.remote(num_cpus=1, max_restarts=0)(_Actor)
        room = int(ray.cluster_resources().get("CPU", 1))
        count = max(1, min(workers or room, room, len(jobs)))
        plan = campaign.plan
        waiting, done = jobs[::-1], 0
        tries: dict[str, int] = {}
        idle = [actor.remote(scene, plan) for _ in range(count)]
        under_way: dict[Any, tuple[str, Any]] = {}
        while waiting or under_way:
            while idle and waiting:
                worker, job = idle.pop(), waiting.pop()
                under_way[worker.run.remote(job)] = (job, worker)
            ready, _ = ray.wait(list(under_way), num_returns=1)
            for reference in ready:
                job, worker = under_way.pop(reference)
                try:
                    files = ray.get(reference)
                except ray.exceptions.RayTaskError as why:
                    raise RuntimeError(str(why).strip().splitlines()[-1]) from why
                except (ray.exceptions.RayActorError, ray.exceptions.ObjectLostError) as why:
                    # The machine or process is gone; the episode has left nothing.
                    tries[job] = tries.get(job, 0) + 1
                    if tries[job] >= TRIES:
                        raise RuntimeError(f"{TRIES} workers were lost over {job}: {why}") from why
                    waiting.append(job)
                    idle.append(actor.remote(scene, plan))
                    continue
                campaign.put(job, files)
                idle.append(worker)
                done += 1
                progress(done, len(jobs))
    finally:
        if begun:
            ray.shutdown()


class _Actor:
    """A worker in a process of Ray's."""

    def __init__(self, scene: str, plan: str):
        # By name: what Ray sends over holds no native class.
        from trocar._native import Worker
        from trocar.campaign import _own_interpreter
        from trocar.envs.cells import phantoms_folder

        _own_interpreter()
        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        self.worker = Worker(scene, folder, plan)

    def run(self, job: str) -> list[tuple[str, bytes]]:
        return self.worker.run(job)


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

    def tell(done: int, missing: int) -> None:
        print(f"\r{done} of {missing} episodes", end="" if done < missing else "\n", file=sys.stderr, flush=True)
        if done == missing:
            print("writing the report, with moving pictures of the first failures", file=sys.stderr, flush=True)

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
        print(f"error: {why}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command goes on", file=sys.stderr)
        return 130
    if options.json:
        print(json.dumps(result))
    else:
        for row in result["policies"]:
            print(f"{row['policy']}: {row['passed']} of {row['episodes']} passed, mean score {row['mean_score']:.2f}")
        print(f"states {result['hash']}\nreport {result['report']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
