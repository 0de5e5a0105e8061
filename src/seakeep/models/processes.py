"""Worker processes: started once, kept warm for the next call, and never left behind."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait as wait_for
from pathlib import Path
from typing import Any, TypeVar

from seakeep.models.crew import Desk, Function, Team, WorkerLostError, do_all, one_blas_thread

__all__ = ["processes"]

Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")

BATCH = 8
"""Small items in one message, at most: handing one over costs 0.2 ms of two processes."""
IDLE = 60.0
"""Seconds for which processes wait for the next call: starting them costs about a second each."""


@contextmanager
def processes(
    function: Function[Data, Item, Result], data: Data, workers: int, small: int | None
) -> Iterator[Team[Item, Result]]:
    """Processes that hold `data`; it is written to a temporary file that each of them reads once.

    Parameters
    ----------
    function : callable
        A function of a module.
    data : object
        What all items need.
    workers : int
        Number of processes.
    small : int or None
        Number of items, where several may go out together.

    Yields
    ------
    Team
        Ready for items. On any error its processes are ended.

    Raises
    ------
    WorkerLostError
        If a process was stopped from outside.
    """
    pool = _WARM.take(workers)

    def submit(items: Sequence[Item]) -> Future[list[Result]]:
        return pool.submit(_work, str(path), function, items)

    try:
        with tempfile.TemporaryDirectory(prefix="seakeep-") as folder:
            path = Path(folder) / "data"
            with path.open("wb") as file:
                pickle.dump(data, file, protocol=5)
            yield Team(submit, workers, 1 if small is None else BATCH)
    except BaseException as error:
        _end(pool)
        if isinstance(error, BrokenProcessPool):
            raise WorkerLostError(
                "a worker process was stopped from outside (was there not enough memory?), or "
                "could not start. With memory short, take fewer workers. In a script, processes "
                "need the line: if __name__ == '__main__':"
            ) from None
        raise
    _WARM.give_back(pool, workers)


class _Warm:
    """The processes of the last call, for the next one that wants as many."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._workers = 0
        self._owner = os.getpid()
        self._timer: threading.Timer | None = None

    def take(self, workers: int) -> ProcessPoolExecutor:
        """The pool that waits, if it fits and lives; else a fresh one."""
        with self._lock:
            pool, self._pool = self._pool, None
            if self._timer is not None:
                self._timer.cancel()
        if pool is not None and self._owner == os.getpid():
            if self._workers == workers and _lives(pool):
                return pool
            pool.shutdown(wait=False)
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(workers, context, initializer=_begin)

    def give_back(self, pool: ProcessPoolExecutor, workers: int) -> None:
        """Keep a pool whose work is done, in the place of one that is there."""
        with self._lock:
            before, self._pool = self._pool, pool
            self._workers, self._owner = workers, os.getpid()
            if self._timer is not None:
                self._timer.cancel()
            self._timer = threading.Timer(IDLE, self._retire, (pool,))
            self._timer.daemon = True
            self._timer.start()
        if before is not None:
            before.shutdown(wait=False)

    def _retire(self, pool: ProcessPoolExecutor) -> None:
        with self._lock:
            if self._pool is not pool:
                return
            self._pool = None
        pool.shutdown(wait=False)


_WARM = _Warm()


def _lives(pool: ProcessPoolExecutor) -> bool:
    # A pool notices the end of a process late: another one may still answer.
    if not all(child.is_alive() for child in (pool._processes or {}).values()):
        return False
    try:
        pool.submit(os.getpid).result()
    except BrokenProcessPool:  # a process that waited was stopped from outside
        return False
    return True


def _end(pool: ProcessPoolExecutor) -> None:
    children = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for child in children:
        child.terminate()
    pool.shutdown(wait=True)


class _Received:
    """What a worker process read last."""

    path: str = ""
    desk: Desk[Any]


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    parent = multiprocessing.parent_process()
    if parent is not None:  # a parent that was killed leaves no worker behind
        sentinel = parent.sentinel
        threading.Thread(target=lambda: (wait_for([sentinel]), os._exit(1)), daemon=True).start()


def _work(path: str, function: Function[Any, Item, Result], items: Sequence[Item]) -> list[Result]:
    if _Received.path != path:
        with Path(path).open("rb") as file:
            _Received.desk = Desk(pickle.load(file))
        _Received.path = path
    with one_blas_thread():
        return do_all(_Received.desk, function, items)
