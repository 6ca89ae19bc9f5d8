"""A campaign's jobs on the workers of a Ray cluster."""

from __future__ import annotations

import json
import logging
import os
import sys
from typing import Any, Callable

from ._native import Campaign
from ._signals import deaf

#: How often a job is tried whose workers are lost, and how many workers in a row may be lost before they are ready.
TRIES = 3
#: After this long without a worker it is said what is waited for [s].
PATIENCE_S = 20.0


class Actor:
    """A worker in a process of Ray's."""

    def __init__(self, scene: str, plan: str):
        self.scene, self.plan = scene, plan

    def ready(self, jobs: list[str]) -> None:
        """Builds the worker, with the policies of `jobs`. Not in `__init__`, whose errors come back as a lost worker's."""
        # By name: what Ray sends over holds no native class.
        from trocar._native import Worker
        from trocar.envs.cells import phantoms_folder

        folder = phantoms_folder()
        folder.mkdir(parents=True, exist_ok=True)
        self.worker = Worker(self.scene, folder, self.plan, python=sys.executable or None)
        self.worker.start(jobs)

    def run(self, job: str) -> list[tuple[str, bytes]]:
        """Runs a job: its episode's files, names and bytes."""
        return self.worker.run(job)


def run_on_ray(
    campaign: Campaign,
    scene: str,
    jobs: list[str],
    workers: int | None,
    address: str,
    progress: Callable[[int, int], None],
) -> None:
    """Runs `jobs` on the cluster at `address`. However it ends, what was finished is kept, and no worker is left.

    ModuleNotFoundError without Ray; RuntimeError for workers that are lost again and again, and for what goes wrong in one.
    """
    try:
        import ray
    except ImportError as why:
        raise ModuleNotFoundError(
            "ray is not installed; pip install '.[ray]', or leave --ray out"
        ) from why
    begun = not ray.is_initialized()
    try:
        if begun:
            options: dict[str, Any] = (
                {} if address != "local" else {"num_cpus": workers or os.cpu_count()}
            )
            dashboard = False if address == "local" else None
            ray.init(address=address, log_to_driver=False, include_dashboard=dashboard, **options)
        crew = _Crew(ray, campaign, scene, jobs, workers)
        try:
            progress(0, len(jobs))
            crew.begin()
            while crew.under_way:
                for reference in crew.wait():
                    if crew.take(reference):
                        progress(crew.done, len(jobs))
                if crew.done == len(jobs):
                    break
        finally:
            with deaf():
                try:
                    crew.stop()
                finally:
                    crew.end()
    finally:
        if begun:
            with deaf():
                ray.shutdown()


class _Crew:
    """Actors. One gets a job once it is ready, so that none waits for an actor that the cluster has no room for."""

    def __init__(
        self, ray: Any, campaign: Campaign, scene: str, jobs: list[str], workers: int | None
    ):
        self.ray, self.campaign, self.scene, self.plan, self.jobs = (
            ray,
            campaign,
            scene,
            campaign.plan,
            jobs,
        )
        self.actor = ray.remote(num_cpus=1, max_restarts=0)(Actor)
        room = int(ray.cluster_resources().get("CPU", 1))
        self.count = max(1, min(workers or room, room, len(jobs)))
        self.waiting, self.done = jobs[::-1], 0
        #: What is done, by what will tell of it: an actor and its job, which is none while it gets ready.
        self.under_way: dict[Any, tuple[Any, str | None]] = {}
        self.idle: list[Any] = []
        self._tries: dict[str, int] = {}
        #: Actors lost in a row before they were ready; none was ready so far.
        self._stillborn, self._alone = 0, True

    def begin(self) -> None:
        """Asks for the actors."""
        for k in range(self.count):
            # A policy that cannot be loaded is told at the beginning, not when its turn comes.
            self._ask(self.jobs if k == 0 else [])

    def _ask(self, policies_of: list[str]) -> None:
        actor = self.actor.remote(self.scene, self.plan)
        self.under_way[actor.ready.remote(policies_of)] = (actor, None)

    def wait(self) -> list[Any]:
        """What is ready; nothing where that takes long."""
        ready, _ = self.ray.wait(list(self.under_way), num_returns=1, timeout=PATIENCE_S)
        if not ready and self._alone:
            self._alone = False
            logging.getLogger("trocar").warning(
                "waiting for a CPU of the cluster: no worker has begun yet"
            )
        return ready

    def take(self, reference: Any) -> bool:
        """Takes what is ready, and hands out the next jobs. Whether it was an episode."""
        actor, job = self.under_way[reference]
        errors = self.ray.exceptions
        try:
            files = self.ray.get(reference)
        except errors.RayTaskError as why:
            raise RuntimeError(_last_line(why)) from why
        except (errors.RayActorError, errors.ObjectLostError) as why:
            # The machine or process is gone; the episode has left nothing.
            del self.under_way[reference]
            self._lost(job, why)
            job = None
        else:
            if job is None:
                self._stillborn, self._alone = 0, False
            else:
                # It is under way until it is kept: an interruption in between must not lose it.
                self.campaign.put(job, files)
                self.done += 1
            del self.under_way[reference]
            self.idle.append(actor)
        while self.idle and self.waiting:
            actor, next_job = self.idle.pop(), self.waiting.pop()
            self.under_way[actor.run.remote(next_job)] = (actor, next_job)
        return job is not None

    def _lost(self, job: str | None, why: Exception) -> None:
        """An actor was lost over `job`, or before it had one: another one is asked for."""
        if job is None:
            self._stillborn += 1
        else:
            self._tries[job] = self._tries.get(job, 0) + 1
            self.waiting.append(job)
        if self._stillborn >= TRIES or self._tries.get(job or "", 0) >= TRIES:
            # Not the whole job: an address may have a token in it.
            over = _named(job) if job else "their cells"
            raise RuntimeError(f"{TRIES} workers were lost over {over}: {_last_line(why)}") from why
        self._ask([])

    def stop(self) -> None:
        """Keeps what was finished meanwhile."""
        jobs = [reference for reference, (_, job) in self.under_way.items() if job is not None]
        finished = self.ray.wait(jobs, num_returns=len(jobs), timeout=0)[0] if jobs else []
        for reference in finished:
            try:
                files = self.ray.get(reference)
            except self.ray.exceptions.RayError:
                continue
            self.campaign.put(self.under_way[reference][1], files)

    def end(self) -> None:
        """Ends the actors, whatever they do."""
        for actor in [*self.idle, *(actor for actor, _ in self.under_way.values())]:
            self.ray.kill(actor)


def _named(job: str) -> str:
    told = json.loads(job)
    return f"episode {told['index']} of {told['policy']['name']}"


def _last_line(why: Exception) -> str:
    """What went wrong, without the traceback."""
    cause = getattr(why, "cause", None)
    lines = str(cause if isinstance(cause, Exception) else why).strip().splitlines()
    return lines[-1] if lines else type(why).__name__
