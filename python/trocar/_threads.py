"""Runs a campaign's jobs on threads of this process. Native code releases Python's global lock."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any

from ._native import Campaign, Stop, Worker
from ._signals import ignore_interrupts
from .envs.cells import phantoms_folder

#: Interval at which the main thread checks for signals (s).
SIGNAL_INTERVAL_S = 0.5


def run_on_threads(
    campaign: Campaign,
    scene: str,
    jobs: list[str],
    workers: int | None,
    progress: Callable[[int, int], None],
    *,
    surfaces: bool = False,
) -> None:
    """Runs `jobs`. However it ends, finished episodes are kept and no thread keeps running.

    ValueError for a scene or policy that cannot be used, OSError for a folder that cannot be
    written.
    """
    pool = _WorkerPool(campaign, scene, jobs, workers, surfaces)
    try:
        progress(0, len(jobs))
        pool.build_workers()
        while pool.running:
            for future in wait(pool.running, SIGNAL_INTERVAL_S, FIRST_COMPLETED).done:
                if pool.take(future):
                    progress(pool.done, len(jobs))
    except BaseException:
        with ignore_interrupts():
            pool.stop()
        raise
    pool.threads.shutdown()


class _WorkerPool:
    """Workers. Each is built on a thread of the pool and then runs one job after the other."""

    def __init__(
        self,
        campaign: Campaign,
        scene: str,
        jobs: list[str],
        workers: int | None,
        surfaces: bool,
    ):
        cores = os.cpu_count() or 1
        self.campaign, self.scene, self.plan = campaign, scene, campaign.plan
        self.jobs, self.waiting, self.done = jobs, jobs[::-1], 0
        self.surfaces = surfaces
        self.count = min(workers or cores, len(jobs))
        self.threads = ThreadPoolExecutor(self.count)
        #: Running tasks: a job and its worker, or None while a worker is built.
        self.running: dict[Future[Any], tuple[str, Worker] | None] = {}
        self._stop, self._builds = Stop(), threading.Semaphore(cores)

    def build_workers(self) -> None:
        """Starts to build the workers."""
        for k in range(self.count):
            self.running[self.threads.submit(self._build, k == 0)] = None

    def _build(self, first: bool) -> Worker:
        # A cell that is being built cannot be interrupted, so at most one a core is built at once.
        with self._builds:
            python = sys.executable or None
            folder = phantoms_folder()
            worker = Worker(
                self.scene,
                folder,
                self.plan,
                stop=self._stop,
                python=python,
                surfaces=self.surfaces,
            )
        if first:
            # A policy that cannot be loaded is reported at once, not when its first job comes.
            worker.start(self.jobs)
        return worker

    def take(self, future: Future[Any]) -> bool:
        """Takes a finished task and gives its worker the next job. Returns if it was an episode."""
        task = self.running[future]
        if task is None:
            worker = future.result()
        else:
            job, worker = task
            # It stays in `running` until it is kept: an interruption in between must not lose it.
            self.campaign.put(job, future.result())
            self.done += 1
        del self.running[future]
        if self.waiting:
            job = self.waiting.pop()
            self.running[self.threads.submit(worker.run, job)] = (job, worker)
        return task is not None

    def stop(self) -> None:
        """Stops all tasks within moments and keeps the episodes that have finished."""
        self._stop.set()
        self.threads.shutdown(wait=True, cancel_futures=True)
        for future, task in self.running.items():
            if task is not None and not future.cancelled() and future.exception() is None:
                self.campaign.put(task[0], future.result())
