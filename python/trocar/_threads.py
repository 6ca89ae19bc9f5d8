"""A campaign's jobs on threads of this process. Native code holds no interpreter's lock, so threads are enough."""

from __future__ import annotations

import os
import sys
import threading
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, Callable

from ._native import Campaign, Stop, Worker
from ._signals import deaf
from .envs.cells import phantoms_folder

#: How often the main thread looks for signals where waiting does not wake for them [s].
GLANCE_S = 0.5


def run_on_threads(
    campaign: Campaign,
    scene: str,
    jobs: list[str],
    workers: int | None,
    progress: Callable[[int, int], None],
) -> None:
    """Runs `jobs`. However it ends, what was finished is kept, and no thread is left at work.

    ValueError for a scene or policy that cannot be used, OSError for a folder that cannot be written.
    """
    crew = _Crew(campaign, scene, jobs, workers)
    try:
        progress(0, len(jobs))
        crew.begin()
        while crew.under_way:
            for future in wait(crew.under_way, GLANCE_S, FIRST_COMPLETED).done:
                if crew.take(future):
                    progress(crew.done, len(jobs))
    except BaseException:
        with deaf():
            crew.stop()
        raise
    crew.pool.shutdown()


class _Crew:
    """Workers, each of which is built in the pool and then runs one job after the other there."""

    def __init__(self, campaign: Campaign, scene: str, jobs: list[str], workers: int | None):
        cores = os.cpu_count() or 1
        self.campaign, self.scene, self.plan, self.jobs = campaign, scene, campaign.plan, jobs
        self.waiting, self.done = jobs[::-1], 0
        self.count = min(workers or cores, len(jobs))
        self.pool = ThreadPoolExecutor(self.count)
        #: What is done, by what will tell of it: a job and its worker, or nothing while a worker is built.
        self.under_way: dict[Future[Any], tuple[str, Worker] | None] = {}
        self._stop, self._turns = Stop(), threading.Semaphore(cores)

    def begin(self) -> None:
        """Has the workers built."""
        for k in range(self.count):
            self.under_way[self.pool.submit(self._build, k == 0)] = None

    def _build(self, first: bool) -> Worker:
        # Nothing stops a cell that is being built: no more at once than get on with it.
        with self._turns:
            worker = Worker(
                self.scene,
                phantoms_folder(),
                self.plan,
                stop=self._stop,
                python=sys.executable or None,
            )
        if first:
            # A policy that cannot be loaded is told at the beginning, not when its turn comes.
            worker.start(self.jobs)
        return worker

    def take(self, future: Future[Any]) -> bool:
        """Takes what is ready, and gives its worker the next job. Whether it was an episode."""
        task = self.under_way[future]
        if task is None:
            worker = future.result()
        else:
            job, worker = task
            # It is under way until it is kept: an interruption in between must not lose it.
            self.campaign.put(job, future.result())
            self.done += 1
        del self.under_way[future]
        if self.waiting:
            job = self.waiting.pop()
            self.under_way[self.pool.submit(worker.run, job)] = (job, worker)
        return task is not None

    def stop(self) -> None:
        """Ends what is under way, within moments, and keeps what was finished meanwhile."""
        self._stop.set()
        self.pool.shutdown(wait=True, cancel_futures=True)
        for future, task in self.under_way.items():
            if task is not None and not future.cancelled() and future.exception() is None:
                self.campaign.put(task[0], future.result())
