"""Work on the workers of a running Dask cluster.

What all items need is pickled once and becomes the value of one task, the root, which every worker
has before the work begins: each fetches it once, from another one. A worker that joins later does
so when it takes over work, and if all that had it are lost, the scheduler makes it again. The other
tasks name the root and carry their items alone. Those of a worker that is lost go to the others.
"""

from __future__ import annotations

import pickle
import platform
import re
import threading
import uuid
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from importlib import metadata
from itertools import count
from typing import Any, TypeVar

from seakeep.errors import RequestError
from seakeep.models.crew import (
    Desk,
    Function,
    Team,
    WorkerLostError,
    do_all,
    one_blas_thread,
)

__all__ = ["Parcel", "check_cluster", "cluster"]

Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")

PATIENCE = 10.0
"""Seconds in which a scheduler must answer, and in which it must have a worker."""
BATCH = 8
"""Small items in one task, at most: a task costs the scheduler about a millisecond."""
ALIKE = ("seakeep", "numpy", "scipy")
"""Packages whose versions must be the same everywhere, so that arrays are."""


def versions() -> dict[str, str]:
    """Versions that must be the same everywhere, of this process."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: metadata.version(name) for name in ALIKE}}


class Parcel:
    """Data on their way to workers: pickled once, unpickled where first needed.

    Parameters
    ----------
    payload : bytes
        The data, pickled.
    expected : mapping of str to str
        Versions of the process that packed it.
    """

    def __init__(self, payload: bytes, expected: Mapping[str, str]) -> None:
        self._payload = payload
        self._expected = dict(expected)
        self._lock = threading.Lock()
        self._desk: Desk[Any] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Parcel, (self._payload, self._expected)

    def __sizeof__(self) -> int:
        return 2 * len(self._payload)

    def desk(self) -> Desk[Any]:
        """The data, ready to be worked with.

        Raises
        ------
        RequestError
            If this process has other versions than the one that packed the parcel.
        """
        with self._lock:
            if self._desk is None:
                found = versions()
                if found != self._expected:
                    raise RequestError(_differences({platform.node(): found}, self._expected))
                self._desk = Desk(pickle.loads(self._payload))
        return self._desk


def _unpacked(payload: bytes, expected: Mapping[str, str]) -> Parcel:
    return Parcel(payload, expected)


def _work(
    parcel: Parcel, function: Function[Any, Item, Result], items: Sequence[Item]
) -> list[Result]:
    with one_blas_thread():
        return do_all(parcel.desk(), function, items)


@contextmanager
def cluster(
    function: Function[Data, Item, Result], data: Data, scheduler: str, small: int | None
) -> Iterator[Team[Item, Result]]:
    """Workers of a Dask cluster that hold `data`.

    Parameters
    ----------
    function : callable
        A function of a module.
    data : object
        What all items need.
    scheduler : str
        Address of the scheduler.
    small : int or None
        Number of items, where several may go out together.

    Yields
    ------
    Team
        Ready for items.

    Raises
    ------
    RequestError
        As :func:`check_cluster`.
    WorkerLostError
        If the scheduler was lost, or a piece of work took several workers with it.
    """
    with _connected(scheduler) as client:
        import dask
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

        _check_alike(client, scheduler)
        name = f"seakeep-{uuid.uuid4().hex}"
        payload = pickle.dumps(data, protocol=5)
        try:
            # The data are meant to travel inside the root, whatever their size.
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
                root = client.submit(_unpacked, payload, versions(), key=f"{name}-data", pure=False)
            client.replicate([root])  # work is given to workers that have what it needs
            executor, numbers = client.get_executor(pure=False), count(1)

            def submit(items: Sequence[Item]) -> Future[list[Result]]:
                future: Future[list[Result]] = executor.submit(
                    _work, root, function, items, key=f"{name}-{next(numbers)}"
                )
                return future

            threads = max(1, sum(client.nthreads().values()))
            batch = 1 if small is None else max(1, min(BATCH, small // (4 * threads)))
            yield Team(submit, threads, batch)
        except KilledWorker as error:
            raise WorkerLostError(
                f"a piece of work took several workers of {scheduler} with it (is their memory "
                f"large enough?): {error}"
            ) from None
        except (CancelledError, CommClosedError):
            raise WorkerLostError(
                f"the connection to the scheduler {scheduler} was lost. Start it again."
            ) from None


def check_cluster(scheduler: str) -> None:
    """Refuse a cluster that cannot be used.

    Parameters
    ----------
    scheduler : str
        Address of the scheduler.

    Raises
    ------
    RequestError
        If Dask is not installed here, no scheduler answers, it has no workers, or they have other
        versions than this process.
    """
    with _connected(scheduler) as client:
        _check_alike(client, scheduler)


@contextmanager
def _connected(scheduler: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ImportError as error:
        raise RequestError(
            f"work on a Dask cluster needs {error.name}, which is not installed. Install it with: "
            "pip install 'seakeep[cluster]'"
        ) from error
    if re.fullmatch(r"(tcp|tls|ucx|wss?|inproc)://\S+", scheduler) is None or not (
        scheduler.startswith("inproc") or re.search(r":\d+/?$", scheduler)
    ):
        raise RequestError(
            f"'{scheduler}' is no address of a Dask scheduler. Give protocol, host and port, as "
            "`dask scheduler` prints them: tcp://HOST:8786."
        )
    try:
        client = Client(
            scheduler,
            timeout=PATIENCE,
            set_as_default=False,
            name="seakeep",
            direct_to_workers=False,
        )
    except (OSError, TimeoutError, ValueError) as error:
        raise RequestError(
            f"no Dask scheduler answers at {scheduler!r} within {PATIENCE:g} s ({error}). Start "
            "one with `dask scheduler`, give its address as tcp://HOST:8786, and see that no "
            "firewall stands between."
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise RequestError(
                f"the Dask scheduler at {scheduler} has no workers. Start some with `dask worker "
                f"{scheduler} --nthreads 1 --nworkers auto`."
            ) from None
        yield client


def _check_alike(client: Any, scheduler: str) -> None:
    """Refuse a cluster with other versions: its arrays would not be those of this machine."""
    found = client.get_versions(packages=list(ALIKE))
    places = {f"the scheduler {scheduler}": found["scheduler"], **found["workers"]}
    expected = versions()
    told = {
        place: {
            "python": ".".join(str(each["host"]["python"]).split(".")[:2]),
            **{name: each["packages"].get(name) for name in ALIKE},
        }
        for place, each in places.items()
    }
    other = {place: each for place, each in told.items() if each != expected}
    if other:
        raise RequestError(_differences(other, expected))


def _differences(
    places: Mapping[str, Mapping[str, str | None]], expected: Mapping[str, str]
) -> str:
    words = [
        f"{place} has "
        + ", ".join(
            f"{name} {found.get(name) or 'not installed'} (here {version})"
            for name, version in expected.items()
            if found.get(name) != version
        )
        for place, found in places.items()
    ]
    return (
        "the Dask cluster would not compute the same arrays: " + "; ".join(words) + ". Install the "
        "same versions everywhere."
    )
