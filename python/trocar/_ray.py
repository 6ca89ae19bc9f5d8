"""Runs a campaign's jobs on the workers of a Ray cluster."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable
from typing import Any

from ._native import Campaign
from ._signals import ignore_interrupts

#: Maximum attempts at a job whose workers are lost, and maximum number of workers in a row that are
#: lost before they are ready.
MAX_ATTEMPTS = 3
#: Time without a worker after which a warning says why nothing happens (s).
WARN_AFTER_S = 20.0


class Actor:
    """A worker in a process of Ray."""

    def __init__(self, scene: str, plan: str, surfaces: bool):
        self.scene, self.plan, self.surfaces = scene, plan, surfaces

    def ready(self, jobs: list[str]) -> None:
        """Builds the worker and loads the policies of `jobs`.

        Not in `__init__`: Ray reports errors there as a lost worker.
        """
        # Imported here: Ray cannot pickle native classes.
        from trocar._native import Worker
        from trocar.envs.cells import phantoms_folder

        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        python = sys.executable or None
        self.worker = Worker(self.scene, folder, self.plan, python=python, surfaces=self.surfaces)
        self.worker.start(jobs)

    def run(self, job: str) -> list[tuple[str, bytes]]:
        """Runs a job and returns its episode's files: names and bytes."""
        return self.worker.run(job)


def run_on_ray(
    campaign: Campaign,
    scene: str,
    jobs: list[str],
    workers: int | None,
    address: str,
    progress: Callable[[int, int], None],
    *,
    surfaces: bool = False,
) -> None:
    """Runs `jobs` on the cluster at `address`.

    However it ends, finished episodes are kept and no worker keeps running. ModuleNotFoundError
    without Ray. RuntimeError for workers that are lost again and again and for an error in one.
    """
    try:
        import ray
    except ImportError as why:
        raise ModuleNotFoundError(
            "ray is not installed; run pip install '.[ray]', or leave out --ray"
        ) from why
    is_own = not ray.is_initialized()
    try:
        if is_own:
            options: dict[str, Any] = (
                {} if address != "local" else {"num_cpus": workers or os.cpu_count()}
            )
            dashboard = False if address == "local" else None
            ray.init(address=address, log_to_driver=False, include_dashboard=dashboard, **options)
        pool = _ActorPool(ray, campaign, scene, jobs, workers, surfaces)
        try:
            progress(0, len(jobs))
            pool.start_actors()
            while pool.running:
                for reference in pool.wait():
                    if pool.take(reference):
                        progress(pool.done, len(jobs))
                if pool.done == len(jobs):
                    break
        finally:
            with ignore_interrupts():
                try:
                    pool.stop()
                finally:
                    pool.end()
    finally:
        if is_own:
            with ignore_interrupts():
                ray.shutdown()


class _ActorPool:
    """The actors of a campaign.

    An actor gets a job once it is ready, so no job waits for an actor that finds no free CPU.
    """

    def __init__(
        self,
        ray: Any,
        campaign: Campaign,
        scene: str,
        jobs: list[str],
        workers: int | None,
        surfaces: bool,
    ):
        self.surfaces = surfaces
        self.ray, self.campaign, self.scene, self.plan = ray, campaign, scene, campaign.plan
        self.actor = ray.remote(num_cpus=1, max_restarts=0)(Actor)
        cpus = int(ray.cluster_resources().get("CPU", 1))
        self.count = max(1, min(workers or cpus, cpus, len(jobs)))
        self.jobs, self.waiting, self.done = jobs, jobs[::-1], 0
        #: Running tasks by their references: an actor and its job, None while the actor gets ready.
        self.running: dict[Any, tuple[Any, str | None]] = {}
        self.idle: list[Any] = []
        self._attempts: dict[str, int] = {}
        #: Actors in a row that were lost before they were ready, and whether none was ready yet.
        self._lost_starting, self._none_ready = 0, True

    def start_actors(self) -> None:
        """Starts the actors."""
        for k in range(self.count):
            # A policy that cannot be loaded is reported at once, not when its first job comes.
            self._start_actor(self.jobs if k == 0 else [])

    def _start_actor(self, policies_of: list[str]) -> None:
        actor = self.actor.remote(self.scene, self.plan, self.surfaces)
        self.running[actor.ready.remote(policies_of)] = (actor, None)

    def wait(self) -> list[Any]:
        """References that are ready, none if that takes longer than `WARN_AFTER_S`."""
        ready: list[Any]
        ready, _ = self.ray.wait(list(self.running), num_returns=1, timeout=WARN_AFTER_S)
        if not ready and self._none_ready:
            self._none_ready = False
            logging.getLogger("trocar").warning(
                "waiting for a free CPU of the cluster: no worker has started yet"
            )
        return ready

    def take(self, reference: Any) -> bool:
        """Takes a finished task and gives idle actors jobs. Returns if it was an episode."""
        actor, job = self.running[reference]
        errors = self.ray.exceptions
        try:
            files = self.ray.get(reference)
        except errors.RayTaskError as why:
            raise RuntimeError(_last_line(why)) from why
        except (errors.RayActorError, errors.ObjectLostError) as why:
            # The machine or process is lost. The episode has left no files.
            del self.running[reference]
            self._lost(job, why)
            job = None
        else:
            if job is None:
                self._lost_starting, self._none_ready = 0, False
            else:
                # It stays in `running` until it is kept: an interruption in between must not
                # lose it.
                self.campaign.put(job, files)
                self.done += 1
            del self.running[reference]
            self.idle.append(actor)
        while self.idle and self.waiting:
            actor, next_job = self.idle.pop(), self.waiting.pop()
            self.running[actor.run.remote(next_job)] = (actor, next_job)
        return job is not None

    def _lost(self, job: str | None, why: Exception) -> None:
        """Replaces an actor that was lost during `job`, or before it had one."""
        if job is None:
            self._lost_starting += 1
        else:
            self._attempts[job] = self._attempts.get(job, 0) + 1
            self.waiting.append(job)
        if self._lost_starting >= MAX_ATTEMPTS or self._attempts.get(job or "", 0) >= MAX_ATTEMPTS:
            # Not the whole job: an address may hold a token.
            during = _named(job) if job else "the construction of their cells"
            raise RuntimeError(
                f"{MAX_ATTEMPTS} workers were lost during {during}: {_last_line(why)}"
            ) from why
        self._start_actor([])

    def stop(self) -> None:
        """Keeps the episodes that have finished."""
        jobs = {ref: job for ref, (_, job) in self.running.items() if job is not None}
        if not jobs:
            return
        finished, _ = self.ray.wait(list(jobs), num_returns=len(jobs), timeout=0)
        for reference in finished:
            try:
                files = self.ray.get(reference)
            except self.ray.exceptions.RayError:
                continue
            self.campaign.put(jobs[reference], files)

    def end(self) -> None:
        """Ends all actors."""
        for actor in [*self.idle, *(actor for actor, _ in self.running.values())]:
            self.ray.kill(actor)


def _named(job: str) -> str:
    content = json.loads(job)
    return f"episode {content['index']} of {content['policy']['name']}"


def _last_line(why: Exception) -> str:
    """The last line of an error: its message without the traceback."""
    cause = getattr(why, "cause", None)
    lines = str(cause if isinstance(cause, Exception) else why).strip().splitlines()
    return lines[-1] if lines else type(why).__name__
