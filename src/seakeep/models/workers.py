"""Members side by side: on threads, on processes, or on a Dask cluster, each on one BLAS thread."""

from __future__ import annotations

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any, Literal, TypeVar

import threadpoolctl

from seakeep.core.scratch import Scratch
from seakeep.errors import RequestError

__all__ = ["Backend", "check_workers", "one_blas_thread", "side_by_side"]

Backend = Literal["threads", "processes"]
Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread: small products side by side beat products spread over cores."""
    context: AbstractContextManager[object] = threadpoolctl.threadpool_limits(1, user_api="blas")
    return context


def check_workers(workers: object, backend: object) -> None:
    """Refuse a number of workers or a backend that does not exist."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise RequestError(f"workers must be a positive integer; received {workers!r}.")
    if backend not in ("threads", "processes"):
        raise RequestError(f"backend must be 'threads' or 'processes'; received {backend!r}.")


def side_by_side(
    function: Callable[[Data, Item, Scratch], Result],
    data: Data,
    items: Sequence[Item],
    workers: int,
    backend: Backend,
) -> Iterator[Result]:
    """Results of `function` for each item, in the order of the items.

    Parameters
    ----------
    function : callable
        Takes `data`, one item, and memory for its work; a function of a module where `backend` is
        "processes".
    data : object
        What all items need; sent to each process once.
    items : sequence
        What there is to do.
    workers : int
        Number of threads or processes; 1 works in the caller's thread.
    backend : {"threads", "processes"}
        Kind of worker.

    Yields
    ------
    object
        Results; no more than a few for each worker wait to be read.
    """
    with one_blas_thread():
        if workers == 1:
            scratch = Scratch()
            for item in items:
                yield function(data, item, scratch)
            return
        with _executor(workers, backend, data) as pool:
            call: Callable[[Item], Result]
            if backend == "threads":
                call = partial(_call_with, function, data, [Scratch() for _ in range(workers)])
            else:
                call = partial(_call, function)
            yield from _in_order(pool, call, items, 3 * workers)


def _call_with(
    function: Callable[[Data, Item, Scratch], Result],
    data: Data,
    idle: list[Scratch],
    item: Item,
) -> Result:
    # No more calls run at a time than there are blocks of memory; pop and append are atomic.
    scratch = idle.pop()
    try:
        return function(data, item, scratch)
    finally:
        idle.append(scratch)


@contextmanager
def _executor(workers: int, backend: Backend, data: object) -> Iterator[Executor]:
    if backend == "threads":
        with ThreadPoolExecutor(workers) as threads:
            yield threads
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_receive, initargs=(data,)) as pool:
        yield pool


def _in_order(
    pool: Executor, call: Callable[[Item], Result], items: Sequence[Item], waiting: int
) -> Iterator[Result]:
    pending: deque[Future[Result]] = deque()
    try:
        for item in items:
            pending.append(pool.submit(call, item))
            if len(pending) >= waiting:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        for future in pending:
            future.cancel()


class _Received:
    """What a worker process was sent when it started."""

    data: object = None
    scratch: Scratch
    limits: object = None


def _receive(data: object) -> None:
    _Received.data, _Received.scratch = data, Scratch()
    _Received.limits = threadpoolctl.threadpool_limits(1, user_api="blas")


def _call(function: Callable[[Any, Item, Scratch], Result], item: Item) -> Result:
    return function(_Received.data, item, _Received.scratch)
