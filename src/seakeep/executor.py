"""Parallel work on any :class:`concurrent.futures.Executor`, or serial work without one.

An executor is a pool of processes (:func:`processes`), Dask's ``client.get_executor()``, or any
object with ``submit``. Results do not depend on it: BLAS has one thread wherever work is done.
"""

import functools
import multiprocessing
import os
import pickle
import platform
import re
import signal
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from concurrent.futures import ProcessPoolExecutor as Pool
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import metadata
from itertools import islice
from multiprocessing.connection import wait as wait_for
from typing import Any, TypeVar

import threadpoolctl

from seakeep.arrays import Progress
from seakeep.errors import RequestError, SeakeepError, needing

Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")
Function = Callable[[Data, Item], Result]
"""What a worker does with one item, and data that all items share."""

BATCHES = 32
"""Pieces, at most, into which small items are handed out: each carries the data once."""
AHEAD = 16
"""Pieces handed out at a time: enough for as many workers, few enough that results stay few."""
PATIENCE = 10.0
"""Seconds in which a Dask scheduler must answer, and after which silent workers are looked for."""
ALIKE = ("seakeep", "numpy", "scipy", "xarray")
"""Packages whose versions must be the same everywhere, so that arrays are."""


class WorkerLostError(SeakeepError):
    """A worker was stopped from outside, and its work with it."""


def in_order(
    function: Function[Data, Item, Result],
    data: Data,
    items: Sequence[Item],
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Iterator[Result]:
    """Yield ``function(data, item)`` for each item, in the order of the items."""
    size = max(-(-len(items) // BATCHES), 1) if executor else 1
    batches = [items[first : first + size] for first in range(0, len(items), size)]
    pieces = _done(function, data, batches, executor, ordered=True)
    results = (result for _, piece in pieces for result in piece)
    for done, result in enumerate(results, 1):
        if progress:
            progress(done, len(items), f"member {done}")
        yield result


def as_finished(
    function: Function[Data, Item, Result],
    data: Data,
    items: Iterable[Item],
    executor: Executor | None = None,
) -> Iterator[tuple[Item, Result]]:
    """Yield each item and ``function(data, item)`` as they finish: large pieces."""
    for (item,), (result,) in _done(function, data, [[item] for item in items], executor):
        yield item, result


def _done(
    function: Function[Data, Item, Result],
    data: Data,
    pieces: Iterable[Sequence[Item]],
    executor: Executor | None,
    ordered: bool = False,
) -> Iterator[tuple[Sequence[Item], list[Result]]]:
    """Yield pieces of the work and their results, in their order or as they finish."""
    if not executor:
        for piece in pieces:
            with one_blas_thread():
                alone = [function(data, item) for item in piece]
            yield piece, alone
        return
    payload, token = pickle.dumps((data, versions()), protocol=5), uuid.uuid4().hex
    waiting, pending = iter(pieces), dict[Future[list[Result]], Sequence[Item]]()
    with ending(executor, pending):
        while True:
            for piece in islice(waiting, AHEAD - len(pending)):
                pending[executor.submit(_work, token, payload, function, piece)] = piece
            if not pending:
                return
            finished = _wait_for_any(islice(pending, 1) if ordered else pending, executor)
            # What is done is handed on before an error is, and nothing is begun after it.
            first = min(finished, key=lambda each: each.exception() is not None)
            if any(each.exception() for each in finished):
                waiting = iter(())
            piece_done = pending.pop(first), first.result()
            # A result that is still referred to would be computed again if its worker were lost.
            del finished, first
            yield piece_done


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread: small products side by side beat products spread over cores."""
    libraries = _blas()
    before = [each.get_num_threads() for each in libraries]
    for each in libraries:
        each.set_num_threads(1)
    try:
        yield
    finally:
        for each, number in zip(libraries, before, strict=True):
            each.set_num_threads(number)


@functools.cache
def _blas() -> list[threadpoolctl.LibController]:
    import scipy.linalg  # noqa: F401  (its BLAS must be loaded to be found)

    found = threadpoolctl.ThreadpoolController().lib_controllers
    return [each for each in found if each.user_api == "blas"]


@contextmanager
def processes(workers: int) -> Iterator[Executor]:
    """Pool of processes, each with BLAS on one thread; ended when the block is left.

    Parameters
    ----------
    workers : int
        Number of processes. A script that starts them needs ``if __name__ == "__main__":``.

    Yields
    ------
    concurrent.futures.Executor
        For the keyword ``executor`` of an ensemble's methods.

    Raises
    ------
    RequestError
        If `workers` is not a positive integer.
    WorkerLostError
        If a process was stopped from outside.

    Examples
    --------
    >>> with processes(2) as executor:  # doctest: +SKIP
    ...     band = ensemble.forecast_summary(run, start=60.0, steps=480, executor=executor)
    """
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise RequestError(f"workers must be a positive integer; received {workers!r}.")
    pool = Pool(workers, multiprocessing.get_context("spawn"), initializer=_start_worker)
    try:
        yield pool
    except BaseException:
        for worker in list((pool._processes or {}).values()):
            worker.kill()
        # The pool would wait for the rest of a result that a worker was sending while this end of
        # the pipe is open.
        pool._result_queue._writer.close()  # type: ignore[attr-defined]
        raise
    pool.shutdown(cancel_futures=True)


def _start_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    parent = multiprocessing.parent_process()
    if parent:  # a parent that was killed leaves no worker behind
        sentinel = parent.sentinel
        threading.Thread(target=lambda: (wait_for([sentinel]), os._exit(1)), daemon=True).start()


def on_this_machine(executor: Executor | None) -> Executor | None:
    """The executor if its workers share this machine's disk, else None."""
    return executor if isinstance(executor, Pool) else None


@contextmanager
def cluster(scheduler: str) -> Iterator[Executor]:
    """Executor of a running Dask cluster.

    Parameters
    ----------
    scheduler : str
        Address of its scheduler, such as ``tcp://host:8786``.

    Yields
    ------
    concurrent.futures.Executor
        For the keyword ``executor`` of an ensemble's methods.

    Raises
    ------
    RequestError
        If the cluster cannot be used.
    """
    with needing("work on a Dask cluster", "cluster"):
        import dask
        from distributed import Client
    if re.fullmatch(r"(tcp|tls|ucx|wss?)://\S+:\d+/?|inproc://\S+", scheduler) is None:
        raise RequestError(
            f"'{scheduler}' is not the address of a Dask scheduler. Give protocol, host and port, "
            "as `dask scheduler` prints them: tcp://HOST:8786."
        )
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False, name="seakeep")
    except (OSError, TimeoutError, ValueError) as error:
        raise RequestError(
            f"no Dask scheduler answers at {scheduler!r} within {PATIENCE:g} s ({error}). Start "
            "one with `dask scheduler`, give its address as tcp://HOST:8786, and check that no "
            "firewall blocks it."
        ) from error
    # A task carries its data; Dask's advice to scatter them is for data that outlive it.
    with client, dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise RequestError(
                f"the Dask scheduler at {scheduler} has no workers. Start some with `dask worker "
                f"{scheduler} --nthreads 1 --nworkers auto`."
            ) from None
        yield client.get_executor(pure=False)


def versions() -> dict[str, str]:
    """Versions that must be the same everywhere, of this process."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: metadata.version(name) for name in ALIKE}}


@contextmanager
def ending(executor: Executor, pending: Iterable[Future[Any]]) -> Iterator[None]:
    """Say how work was lost; what is not done is cancelled when the block is left.

    Except in a pool of processes: it fails over a cancelled future when its workers are killed.
    """
    _check_alive(executor)
    try:
        yield
    except BrokenProcessPool:  # the pool ends its futures itself
        raise WorkerLostError(
            "a worker process was stopped from outside (was there not enough memory?), or could "
            "not start. With memory short, take fewer workers. In a script, processes need the "
            "line: if __name__ == '__main__':"
        ) from None
    except BaseException as error:
        for future in () if on_this_machine(executor) else tuple(pending):
            future.cancel()
        if isinstance(error, CancelledError):
            raise WorkerLostError(
                "the connection to the scheduler of the cluster was lost. Start it again."
            ) from None
        if type(error).__name__ == "KilledWorker":  # of Dask, which may not be installed
            raise WorkerLostError(
                "several workers of the cluster were lost over one piece of work (is their memory "
                f"large enough?): {error}"
            ) from None
        raise


def _wait_for_any(pending: Iterable[Future[Result]], executor: Executor) -> set[Future[Result]]:
    """Futures that are done, at least one; a cluster without workers is not waited for."""
    pending = list(pending)
    while not (done := wait(pending, timeout=PATIENCE, return_when=FIRST_COMPLETED).done):
        _check_alive(executor)
    return done


def _check_alive(executor: Executor) -> None:
    """Refuse Dask's executor where no scheduler or no worker answers: it would never return."""
    client = getattr(executor, "_client", None)  # it has no public way to ask
    if client is None:
        return
    try:
        alive = client.status != "closed" and bool(client.nthreads())
    except (OSError, RuntimeError, TimeoutError, CancelledError):  # it may have closed itself
        alive = False
    if not alive:
        raise WorkerLostError(
            "the Dask cluster has no workers that answer. Start its scheduler and its workers "
            "again, and connect a new client."
        )


_received: tuple[str, Any] = "", None


def _work(
    token: str, payload: bytes, function: Function[Any, Item, Result], items: Sequence[Item]
) -> list[Result]:
    """Results of some items in a worker, which reads the data once."""
    global _received
    if (received := _received)[0] != token:
        (data, expected), installed = pickle.loads(payload), versions()
        other = [
            f"{name} {installed[name]} (here {version})"
            for name, version in expected.items()
            if installed.get(name) != version
        ]
        if other:  # the arrays would not be those of the caller
            raise RequestError(
                f"the worker {platform.node()} would not compute the same arrays: it has "
                f"{', '.join(other)}. Install the same versions everywhere."
            )
        received = _received = token, data
    with one_blas_thread():
        return [function(received[1], item) for item in items]
