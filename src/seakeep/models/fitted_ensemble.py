"""A fitted ensemble: its draws, its members on demand, their forecasts, and its file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import RequestError
from seakeep.models import aligned, ensemble_store, forecasting, store
from seakeep.models.alignment import FittedAlignment
from seakeep.models.draws import Draw
from seakeep.models.forecasting import ForecastWindow
from seakeep.models.labelled import ChannelLabel
from seakeep.models.members import Task, TrainingArrays, forecast_member, identify_member
from seakeep.models.model import HankelDMDcModel, Training
from seakeep.models.offsets import check_offset
from seakeep.models.settings import HankelSettings
from seakeep.models.summaries import STATISTICS, check_level, first_lost, reduce_members
from seakeep.models.workers import Backend, check_workers, side_by_side

__all__ = ["HankelEnsemble"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HankelEnsemble:
    """Members that differ in their settings, or in what they learned from.

    Made by :meth:`BayesianHankelDMDc.fit` or :func:`seakeep.load_model`. It holds draws and
    training arrays; a member's matrices exist while it is at work, and no longer.

    Parameters
    ----------
    settings : HankelSettings
        What all members share.
    origin : dict
        Priors, seed and rules that made the draws, as plain data.
    members : tuple of Draw
        Settings of each member.
    arrays : TrainingArrays
        What they learn from.
    dt : float
        Time step, s.
    state_labels, input_labels : tuple of ChannelLabel
        Names and units of states and inputs.
    alignment : FittedAlignment, optional
        How the wave input is aligned to the vessel; the training arrays are aligned.
    """

    settings: HankelSettings = field(repr=False)
    origin: dict[str, Any]
    members: tuple[Draw, ...] = field(repr=False)
    arrays: TrainingArrays = field(repr=False)
    dt: float
    state_labels: tuple[ChannelLabel, ...]
    input_labels: tuple[ChannelLabel, ...]
    alignment: FittedAlignment | None = None

    @property
    def n_members(self) -> int:
        """Number of members."""
        return len(self.members)

    @property
    def states(self) -> list[str]:
        """Names of the states, in the order of the members."""
        return [label.name for label in self.state_labels]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs, in the order of the members."""
        return [label.name for label in self.input_labels]

    @property
    def state_delays(self) -> int:
        """Longest s of a member."""
        return max(draw.state_delays for draw in self.members)

    @property
    def input_delays(self) -> int:
        """Longest z of a member."""
        return max(draw.input_delays for draw in self.members)

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, so that every member has its history."""
        return max(self.state_delays, self.input_delays) + 1

    @cached_property
    def draws(self) -> xr.Dataset:
        """What was drawn, over ``member``.

        ``train_length``, ``state_delay`` and ``input_delay`` in encounter periods (NaN where all
        of a run trains), the integers ``…_samples`` they became (−1 for all of a run), ``ridge``,
        the run that trains (−1 for all) and its last sample (−1 for ``stop``), and how many
        infeasible draws came before.
        """
        return ensemble_store.draws_dataset(self.members, self.origin)

    def member(self, number: int) -> HankelDMDcModel:
        """One member as a model of its own.

        Parameters
        ----------
        number : int
            Which, from zero.

        Returns
        -------
        HankelDMDcModel
            Equal to :class:`HankelDMDc` with the member's settings and data.

        Raises
        ------
        RequestError
            If there is no such member.
        """
        if not 0 <= number < self.n_members:
            raise RequestError(
                f"there is no member {number!r}: the ensemble has {self.n_members}, counted from "
                f"0 to {self.n_members - 1}."
            )
        draw = self.members[number]
        found = identify_member(self.arrays, self.settings, draw)
        settings = replace(
            self.settings,
            state_delays=draw.state_delays,
            input_delays=draw.input_delays,
            ridge=draw.ridge,
            window=draw.window,
        )
        first, stop = [], []
        for run, window in zip(found.runs, found.windows, strict=True):
            end = draw.last
            end = (
                len(self.arrays.states[run]) - 1 if end is None else end - self.arrays.offsets[run]
            )
            stop.append(self.arrays.begins[run] + end * self.dt)
            first.append(stop[-1] - (window.last - window.first) * self.dt)
        return HankelDMDcModel(
            settings=settings,
            coefficients=found.solution.coefficients,
            dt=self.dt,
            state_labels=self.state_labels,
            input_labels=self.input_labels,
            state_scale=found.state_scale,
            input_scale=found.input_scale,
            training=Training(
                runs=tuple(self.arrays.names[run] for run in found.runs),
                first=tuple(first),
                stop=tuple(stop),
                columns=tuple(window.columns for window in found.windows),
                method=found.solution.method,
                ridge=found.solution.ridge,
                rank=found.solution.rank,
            ),
            alignment=self.alignment,
        )

    def forecast(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        *,
        workers: int = 1,
        backend: Backend = "threads",
    ) -> xr.Dataset:
        """Free runs of all members.

        Parameters
        ----------
        run, start, steps
            As in :meth:`HankelDMDcModel.forecast`.
        workers : int, optional
            Members at work at a time; the result does not depend on it.
        backend : {"threads", "processes"}, optional
            Kind of worker.

        Returns
        -------
        Dataset
            States with dimensions (member, time), and ``status`` over ``member``. A member that
            diverges is NaN from there on.

        Raises
        ------
        RequestError, DataError
            As :meth:`HankelDMDcModel.forecast`.
        """
        windows = self._windows(run, [start], steps)
        values = np.stack(list(self._series(run, windows, workers, backend)))[:, 0]
        lost = first_lost(values)
        variables = self._variables(values, ("member", "time"))
        variables["status"] = xr.Variable(("member",), _status(lost, windows[0].time.values))
        return xr.Dataset(
            variables,
            coords={"member": np.arange(self.n_members), "time": windows[0].time},
            attrs=self._attributes(run, windows[0]) | _verdict(lost) | {"start": windows[0].start},
        )

    def forecast_summary(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        level: float = 0.95,
        *,
        workers: int = 1,
        backend: Backend = "threads",
    ) -> xr.Dataset:
        """Mean, standard deviation and band of the members, never all of them at once.

        Parameters
        ----------
        run, start, steps, workers, backend
            As in :meth:`forecast`.
        level : float, optional
            Probability between ``lower`` and ``upper``.

        Returns
        -------
        Dataset
            As :func:`seakeep.summarize` makes of :meth:`forecast`, dimensions (statistic, time),
            with ``status`` over ``member``. More than 32 MiB of members are spilled to a
            temporary file and reduced in pieces of time.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        level = check_level(level)
        (window,) = self._windows(run, [start], steps)
        series = self._series(run, [window], workers, backend)
        shape = (1, window.steps, len(self.states))
        values, lost = reduce_members(series, self.n_members, shape, level)
        variables = self._variables(values[0], ("statistic", "time"))
        variables["status"] = xr.Variable(("member",), _status(lost[:, 0], window.time.values))
        counts = {"level": level, "members": self.n_members, **_verdict(lost)}
        return xr.Dataset(
            variables,
            coords={
                "statistic": list(STATISTICS),
                "member": np.arange(self.n_members),
                "time": window.time,
            },
            attrs=self._attributes(run, window) | {"start": window.start} | counts,
        )

    def forecast_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        *,
        workers: int = 1,
        backend: Backend = "threads",
    ) -> xr.Dataset:
        """Free runs of all members from several starts side by side.

        Parameters
        ----------
        run, steps, workers, backend
            As in :meth:`forecast`; `steps` holds for all.
        starts : sequence of float
            Instants of the last measured state, s.

        Returns
        -------
        Dataset
            States with dimensions (window, member, lead), ``lead`` in s after each ``start``
            (over ``window``), and ``status`` over (window, member).

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        windows = self._windows(run, starts, steps)
        values = np.stack(list(self._series(run, windows, workers, backend)), axis=1)
        first = first_lost(values)
        variables = self._variables(values, ("window", "member", "lead"))
        status = [
            _status(row, window.time.values) for row, window in zip(first, windows, strict=True)
        ]
        variables["status"] = xr.Variable(("window", "member"), np.stack(status))
        coords = self._window_coords(windows) | {"member": np.arange(self.n_members)}
        return xr.Dataset(variables, coords=coords, attrs=self._attributes(run, windows[0]))

    def summarize_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        level: float = 0.95,
        *,
        workers: int = 1,
        backend: Backend = "threads",
    ) -> xr.Dataset:
        """Mean, standard deviation and band from several starts, never all members at once.

        Parameters
        ----------
        run, starts, steps, workers, backend
            As in :meth:`forecast_windows`.
        level : float, optional
            Probability between ``lower`` and ``upper``.

        Returns
        -------
        Dataset
            Dimensions (window, statistic, lead); ``diverged`` counts over ``window``.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        level = check_level(level)
        windows = self._windows(run, starts, steps)
        shape = (len(windows), windows[0].steps, len(self.states))
        series = self._series(run, windows, workers, backend)
        values, lost = reduce_members(series, self.n_members, shape, level)
        variables = self._variables(values, ("window", "statistic", "lead"))
        variables["diverged"] = xr.Variable(("window",), (lost >= 0).sum(axis=0))
        coords = self._window_coords(windows) | {"statistic": list(STATISTICS)}
        attrs = self._attributes(run, windows[0]) | {"level": level, "members": self.n_members}
        return xr.Dataset(variables, coords=coords, attrs=attrs)

    def _windows(
        self, run: xr.Dataset, starts: Sequence[float], steps: int | None
    ) -> list[ForecastWindow]:
        windows = [forecasting.read_window(self, run, float(start), steps) for start in starts]
        if not windows:
            raise RequestError("starts is empty: name at least one instant to forecast from.")
        if self.alignment is None:
            return windows
        check_offset(run)
        if self.alignment.settings.surge == "predicted":
            return windows
        return [aligned.align_window(self, run, window) for window in windows]

    def _series(
        self,
        run: xr.Dataset,
        windows: Sequence[ForecastWindow],
        workers: int,
        backend: Backend,
    ) -> Iterator[FloatArray]:
        """Members one after the other, each (window, steps, N)."""
        check_workers(workers, backend)
        if self.alignment is not None and self.alignment.settings.surge == "predicted":
            members = map(self.member, range(self.n_members))
            return (
                np.stack([aligned.closed_loop(member, run, window) for window in windows])
                for member in members
            )
        histories = np.stack([window.state_history for window in windows])
        inputs = np.stack([np.concatenate([w.input_history, w.input_future]) for w in windows])
        task = Task(self.arrays, self.settings, histories, inputs, windows[0].steps)
        return side_by_side(forecast_member, task, self.members, workers, backend)

    def _variables(self, values: FloatArray, dims: tuple[str, ...]) -> dict[str, xr.Variable]:
        return {
            label.name: xr.Variable(
                dims, values[..., column], {"units": label.units, "long_name": label.long_name}
            )
            for column, label in enumerate(self.state_labels)
        }

    def _window_coords(self, windows: Sequence[ForecastWindow]) -> dict[str, xr.Variable]:
        lead = self.dt * np.arange(1, windows[0].steps + 1)
        starts = np.array([window.start for window in windows])
        return {
            "start": xr.Variable(("window",), starts, {"units": "s", "long_name": "start"}),
            "lead": xr.Variable(("lead",), lead, {"units": "s", "long_name": "time after start"}),
        }

    def _attributes(self, run: xr.Dataset, window: ForecastWindow) -> dict[str, Any]:
        notes = {} if self.alignment is None else aligned.notes(self.alignment, run)
        return {"run": window.name, "ensemble": json.dumps(self.origin), **notes}

    def save(self, path: str | Path) -> Path:
        """Write draws and training arrays as NetCDF, to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File, overwritten if it exists.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_model` reads it, running no code from it.
        """
        return store.write(self.to_dataset(), path, ensemble_store.BAYESIAN_HANKEL_DMDC)

    def to_dataset(self) -> xr.Dataset:
        """The ensemble as a Dataset: what :meth:`save` writes."""
        return ensemble_store.pack(
            settings=self.settings,
            origin=self.origin,
            members=self.members,
            arrays=self.arrays,
            dt=self.dt,
            labels={"state": self.state_labels, "input": self.input_labels},
            alignment=self.alignment,
        )

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Rebuild an ensemble from :meth:`to_dataset`.

        Parameters
        ----------
        dataset : Dataset
            What :meth:`save` wrote.

        Returns
        -------
        HankelEnsemble
            Its members are equal to the last bit.
        """
        parts = ensemble_store.unpack(dataset)
        return cls(
            settings=parts.settings,
            origin=parts.origin,
            members=parts.members,
            arrays=parts.arrays,
            dt=parts.dt,
            state_labels=parts.labels["state"],
            input_labels=parts.labels["input"],
            alignment=parts.alignment,
        )


def _verdict(lost: npt.NDArray[np.int64]) -> dict[str, Any]:
    diverged = int(np.count_nonzero(lost >= 0))
    status = f"{diverged} of {len(lost)} members diverged" if diverged else "ok"
    return {"status": status, "diverged": diverged}


def _status(first_lost: npt.NDArray[np.int64], time: FloatArray) -> npt.NDArray[np.str_]:
    return np.array(
        ["ok" if at < 0 else f"diverged at t = {time[at]:g} s" for at in first_lost], dtype=str
    )
