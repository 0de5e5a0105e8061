"""Who works, where a worker sits, and how many threads BLAS has there."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Literal, TypeVar, get_args

import threadpoolctl

from seakeep.errors import RequestError, SeakeepError
from seakeep.models.checks import check_choice

__all__ = [
    "Backend",
    "Crew",
    "Desk",
    "Function",
    "Team",
    "WorkerLostError",
    "do_all",
    "one_blas_thread",
]

Backend = Literal["processes", "threads", "auto"]
Data = TypeVar("Data")
Item = TypeVar("Item")
Result = TypeVar("Result")
Function = Callable[[Data, Item], Result]


class WorkerLostError(SeakeepError):
    """A worker was stopped from outside, and its work with it."""


@dataclass(frozen=True)
class Crew:
    """Who does the work.

    Parameters
    ----------
    workers : int, optional
        Workers on this machine; 1 works in the caller's thread.
    backend : {"processes", "threads", "auto"}, optional
        Their kind. With "auto" the caller's thread begins, and what is left goes to processes
        where they save more time than they may take to start.
    scheduler : str, optional
        Address of the scheduler of a running Dask cluster, such as ``tcp://host:8786``, whose
        workers do it instead.

    Raises
    ------
    RequestError
        If a value does not exist, or local workers are asked for beside a cluster.
    """

    workers: int = 1
    backend: Backend = "processes"
    scheduler: str | None = None

    def __post_init__(self) -> None:
        workers: object = self.workers
        if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
            raise RequestError(f"workers must be a positive integer; received {workers!r}.")
        check_choice("backend", self.backend, get_args(Backend))
        if self.scheduler is not None and workers != 1:
            raise RequestError(
                f"workers = {workers} counts workers on this machine, and scheduler = "
                f"{self.scheduler!r} hands all work to a cluster. Give one of the two."
            )

    @property
    def has_processes(self) -> bool:
        """Whether processes of this machine may work."""
        return self.scheduler is None and self.workers > 1 and self.backend != "threads"


class Desk(Generic[Data]):
    """What all items need.

    Parameters
    ----------
    data : object
        What all items need.
    """

    def __init__(self, data: Data) -> None:
        self._data = data

    def do(self, function: Function[Data, Item, Result], item: Item) -> Result:
        """Call ``function(data, item)``; several threads may do so at a time."""
        return function(self._data, item)


@dataclass(frozen=True)
class Team(Generic[Item, Result]):
    """Workers that wait for items.

    Parameters
    ----------
    submit : callable
        Takes an item and gives the future of its result.
    workers : int
        Workers.
    batch : int
        Items handed out together at most, where handing out one costs as much as a small one's
        work.
    """

    submit: Callable[[Sequence[Item]], Future[list[Result]]]
    workers: int
    batch: int = 1

    @property
    def ahead(self) -> int:
        """Batches handed out at a time.

        Enough that no worker waits, few enough that results that are not yet read stay few.
        """
        return 3 * self.workers


def do_all(
    desk: Desk[Any], function: Function[Any, Item, Result], items: Sequence[Item]
) -> list[Result]:
    """Results of some items at a desk."""
    return [desk.do(function, item) for item in items]


class _OneBlasThread:
    """One limit for all that work in this process; the last to leave lifts it.

    OpenBLAS has one pool of threads a process. From threadpoolctl 3.8 on its limit belongs to the
    Python thread that set it first, and others are ignored; here whoever comes first and whoever
    leaves last may be different threads, so the limit is taken over from its owner.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._controller: Any = None
        self._modules = 0
        self._limits: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                if self._modules != len(sys.modules):  # a library may have come with a module
                    self._controller = threadpoolctl.ThreadpoolController()
                    self._modules = len(sys.modules)
                self._take_over()
                self._limits = self._controller.limit(limits=1, user_api="blas")
            self._inside += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._take_over()
                self._limits.restore_original_limits()
                self._take_over()

    def _take_over(self) -> None:
        for library in self._controller.lib_controllers:
            if hasattr(library, "clear_controlling_thread"):
                library.clear_controlling_thread(force=True)


_ONE_BLAS_THREAD = _OneBlasThread()


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread: small products side by side beat products spread over cores.

    Several threads may be inside at a time.
    """
    return _ONE_BLAS_THREAD
