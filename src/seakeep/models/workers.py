"""Work side by side: in the caller's thread, on threads, on processes, or on a Dask cluster.

One seam for the members of an ensemble and the cells of a study: a function, what all items need,
and the items. Who does them is a :class:`Crew`; the results do not depend on it. Everywhere BLAS
has one thread, so that workers do not fight for cores.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from itertools import islice
from typing import TypeVar

from seakeep.models.crew import (
    Backend,
    Crew,
    Desk,
    Function,
    Team,
    WorkerLostError,
    do_all,
    one_blas_thread,
)

__all__ = [
    "Backend",
    "Crew",
    "Function",
    "WorkerLostError",
    "as_finished",
    "check_crew",
    "one_blas_thread",
    "side_by_side",
]

Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")

WORTH = 6.0
"""Seconds that processes must save: two were ready after 2 s on idle cores and 6 s on busy ones."""
TRIED = 3
"""Items by which the time of the others is judged: the first one also loads what it needs."""


def check_crew(crew: Crew) -> None:
    """Refuse a cluster that cannot be used, before work is prepared for it.

    Parameters
    ----------
    crew : Crew
        Who will do the work.

    Raises
    ------
    RequestError
        If Dask is not installed here, no scheduler answers, it has no workers, or they have other
        versions than this process.
    """
    if crew.scheduler is not None:
        from seakeep.models.cluster import check_cluster

        check_cluster(crew.scheduler)


def side_by_side(
    function: Function[Data, Item, Result], data: Data, items: Sequence[Item], crew: Crew
) -> Iterator[Result]:
    """Results of `function` for each item, in the order of the items.

    Parameters
    ----------
    function : callable
        Takes `data`, one item, and memory for its work; a function of a module, unless the work
        stays in this process.
    data : object
        What all items need; it reaches each worker once.
    items : sequence
        What there is to do, each a small piece of work.
    crew : Crew
        Who does it.

    Yields
    ------
    object
        Results; no more than a few for each worker wait to be read.

    Raises
    ------
    WorkerLostError
        If a worker process was stopped from outside.
    RequestError
        If the cluster cannot be used.
    """
    if crew == Crew(1, crew.backend):
        yield from _alone(function, data, items)
        return
    if crew.backend == "auto" and crew.scheduler is None:
        done = yield from _until_worth(function, data, items, crew.workers)
        items = items[done:]
        if not items:
            return
    with _team(function, data, crew, len(items)) as team:
        pending: deque[Future[list[Result]]] = deque()
        first = 0
        while first < len(items):
            # Fewer at a time towards the end, so that no worker waits long for another.
            size = min(team.batch, max(1, (len(items) - first) // team.workers))
            pending.append(team.submit(items[first : first + size]))
            first += size
            if len(pending) >= team.ahead:
                yield from pending.popleft().result()
        while pending:
            yield from pending.popleft().result()


def as_finished(
    function: Function[Data, Item, Result], data: Data, items: Sequence[Item], crew: Crew
) -> Iterator[tuple[int, Result]]:
    """Results with the numbers of their items, as they are finished; for large pieces of work.

    Parameters
    ----------
    function, data, items, crew
        As in :func:`side_by_side`.

    Yields
    ------
    (int, object)
        Number of the item, and its result.

    Raises
    ------
    WorkerLostError, RequestError
        As :func:`side_by_side`.
    """
    if crew == Crew(1, crew.backend):
        yield from enumerate(_alone(function, data, items))
        return
    with _team(function, data, crew, None) as team:
        waiting = enumerate(items)
        pending = {team.submit([item]): number for number, item in islice(waiting, team.ahead)}
        while pending:
            finished = wait(pending, return_when=FIRST_COMPLETED).done
            failed = [future for future in finished if future.exception() is not None]
            ready = [(pending.pop(f), f.result()[0]) for f in finished if f not in failed]
            # A future that is held has its result made again if its worker is lost.
            del finished
            for number, result in ready:
                for following, item in islice(waiting, 1):
                    pending[team.submit([item])] = following
                yield number, result
            for future in failed:
                future.result()


def _alone(
    function: Function[Data, Item, Result], data: Data, items: Sequence[Item]
) -> Iterator[Result]:
    desk = Desk(data)
    with one_blas_thread():
        for item in items:
            yield desk.do(function, item)


def _until_worth(
    function: Function[Data, Item, Result], data: Data, items: Sequence[Item], workers: int
) -> Generator[Result, None, int]:
    """Results of the first items, until processes would save time; returns their number."""
    desk, spent = Desk(data), 0.0
    for done, item in enumerate(items):
        left = spent / max(done, 1) * (len(items) - done)
        if done >= TRIED and left * (1 - 1 / workers) > WORTH:
            return done
        begin = time.perf_counter()
        with one_blas_thread():
            found = desk.do(function, item)
        spent += time.perf_counter() - begin
        yield found
    return len(items)


def _team(
    function: Function[Data, Item, Result], data: Data, crew: Crew, small: int | None
) -> AbstractContextManager[Team[Item, Result]]:
    """Workers of a crew; `small` is the number of items where each is a small piece of work."""
    if crew.scheduler is not None:
        from seakeep.models.cluster import cluster

        return cluster(function, data, crew.scheduler, small)
    if crew.backend == "threads":
        return _threads(function, data, crew.workers)
    from seakeep.models.processes import processes

    return processes(function, data, crew.workers, small)


@contextmanager
def _threads(
    function: Function[Data, Item, Result], data: Data, workers: int
) -> Iterator[Team[Item, Result]]:
    pool, desk = ThreadPoolExecutor(workers), Desk(data)

    def submit(items: Sequence[Item]) -> Future[list[Result]]:
        return pool.submit(do_all, desk, function, items)

    try:
        with one_blas_thread():
            yield Team(submit, workers)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
