r"""A fitted ensemble: its draws, its members on demand, their forecasts, and its file.

Every member has a generator of its own, the k-th child of the seed, and reads its numbers from it
alone, or from the k-th point of a Sobol net that the seed itself scrambles: a member is the same
for any number of members or workers, in any order of work.

Lengths are drawn in the unit of their prior and become samples by rounding to the nearest integer,
halves upwards (:func:`~seakeep.models.settings.in_samples`). A draw is infeasible where a run that
trains the member does not hold the window with its delay history before it (``history="before"``:
m + max(s, z) samples; ``"inside"``: m samples, and max(s, z) + 2 of them), an integer is out of
range, or a quantile is not finite. All of it is then drawn again from the member's own generator,
and counted.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

import numpy as np
import numpy.typing as npt
import scipy
import xarray as xr

from seakeep.arrays import FloatArray, IntArray, Json, Progress, check_choice, fraction
from seakeep.core.embedding import History
from seakeep.core.solve import Solution
from seakeep.errors import DataError, RequestError, quiet, warn
from seakeep.executor import in_order
from seakeep.models import store
from seakeep.models.calibration import (
    Band,
    BandScale,
    Calibration,
    calibrate,
    calibrated_for,
    widened,
)
from seakeep.models.engine import Dynamics, Series, Windows, linear_runs, member_series
from seakeep.models.forecasts import (
    check_arrays,
    counted,
    forecast_attrs,
    label_channels,
    reduce_members,
    statistic_coordinate,
    statuses,
    weigh_members,
    windows_dataset,
    with_units,
)
from seakeep.models.growth import LeadErrors, Stretch, linear_errors
from seakeep.models.inputs import InputMap, Signature
from seakeep.models.labelled import Runs
from seakeep.models.linear import HankelDMDcModel, spectral_radius
from seakeep.models.live import Servable
from seakeep.models.settings import HankelSettings, unit_of
from seakeep.models.training import RunArrays, TrainingData, departing, member_data
from seakeep.models.validity import Coverage
from seakeep.signals.time_axis import span_text

Sampling = Literal["monte_carlo", "sobol"]
TrainOn = Literal["all", "runs", "windows", "auto"]

PRIORS = ("window", "state_delays", "input_delays", "ridge")
"""Settings that are drawn, in the order of a member's numbers."""
DRAWN = {
    "window": "length of the training window",
    "state_delays": "longest delay of the states",
    "input_delays": "longest delay of the inputs",
}
MOST_REDRAWS = 1000
"""After so many infeasible draws of one member the priors are taken not to fit the data."""


@dataclass(frozen=True)
class Draw:
    """A member: its settings, and what trains it.

    Parameters
    ----------
    settings : HankelSettings
        As of a :class:`HankelDMDc`, in samples.
    drawn : tuple of float
        Window and delays of states and inputs as drawn, in the units of their priors; the first is
        NaN where all of a run trains.
    run : int or None
        The run that trains, None for all of them.
    last : int or None
        Last sample of the window in that run, None for the end of what is given.
    redrawn : int
        Infeasible draws before this one.
    """

    settings: HankelSettings
    drawn: tuple[float, float, float]
    run: int | None = None
    last: int | None = None
    redrawn: int = 0

    def needed(self, input_map: InputMap) -> int:
        """Samples of a run that the window, its history and its look-ahead take."""
        settings = self.settings
        reach = settings.reach(input_map)
        least = reach + 2 + input_map.around.after
        if settings.window is None:
            return least
        inside = settings.history == "inside"
        return max(settings.window, least) if inside else settings.window + reach

    def first(self, run: int, samples: int, input_map: InputMap) -> int:
        """Earliest of the samples of a run that the member reads; their number if it reads none."""
        if self.run not in (None, run):
            return samples
        end = samples if self.last is None else self.last + 1
        return 0 if self.settings.window is None else end - self.needed(input_map)


KEPT = ("arrays", "signature", "coverage", "calibration", "selection")
"""What a file keeps beside the draws."""
SAMPLING = {"monte_carlo": "Monte Carlo", "sobol": "Sobol"}
TRAIN_ON = {
    "all": "together",
    "runs": "one of them per member, drawn",
    "windows": "a window of one of them per member, drawn",
}


class BandForecast(NamedTuple):
    """Forecast of an ensemble as plain arrays, physical units.

    Attributes
    ----------
    mean, std, lower, upper : ndarray, shape (steps, N)
        Mean, standard deviation and bounds over the members, at k + 1 … k + steps.
    diverged : int
        Members that diverged and are left out of all four.
    """

    mean: FloatArray
    std: FloatArray
    lower: FloatArray
    upper: FloatArray
    diverged: int


@dataclass(frozen=True, eq=False)
class HankelEnsemble(Servable):
    """Ensemble of models that differ in their settings or their training data.

    Made by :meth:`BayesianHankelDMDc.fit` or :func:`seakeep.load_model`. It holds draws and
    training arrays; a member's matrices exist only while they are used.

    Parameters
    ----------
    settings : HankelSettings
        Settings that all members share.
    origin : dict
        Priors, seed and rules that made the draws, as JSON values.
    members : tuple of Draw
        Settings of each member, and what trains it.
    arrays : tuple of RunArrays
        Training data of the members, by run.
    signature : Signature
        Time step, names and units, longest delays, and how inputs drive the members.
    coverage : Coverage
        Waves that they were trained in.
    calibration : Calibration, optional
        Numbers that make the calibrated band; see :meth:`calibrate`.
    selection : str
        How free runs chose what the settings left open; empty where they stated all.
    identified : tuple of Dynamics
        All members with their matrices, where :meth:`hold` keeps them, and what they are centred
        on; empty where each call identifies them anew.
    centre : Draw, optional
        The single model of all runs that the members' mean is moved to.
    """

    kind: ClassVar[str] = "bayesian_hankel_dmdc"
    settings: HankelSettings
    origin: Json
    members: tuple[Draw, ...]
    arrays: tuple[RunArrays, ...]
    signature: Signature
    coverage: Coverage
    calibration: Calibration | None = None
    selection: str = ""
    identified: tuple[Dynamics, ...] = field(default=(), repr=False)
    centre: Draw | None = None

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(n_members={self.n_members}, states={self.states}, "
            f"inputs={self.inputs}, dt={self.dt:g}; print(ensemble.summary()) says more)"
        )

    @property
    def n_members(self) -> int:
        """Number of members."""
        return len(self.members)

    @property
    def is_centred(self) -> bool:
        """Whether the mean of the members is the forecast of a single model of all runs."""
        return self.centre is not None

    @cached_property
    def _taught(self) -> tuple[Draw, ...]:
        """The members, and what they are centred on."""
        return self.members if self.centre is None else (*self.members, self.centre)

    @cached_property
    def draws(self) -> xr.Dataset:
        """Drawn settings, over ``member``.

        ``window``, ``state_delays`` and ``input_delays`` as drawn, in the units of their priors
        (NaN where all of a run trains), the integers ``…_samples`` they became (−1 for all of a
        run), ``ridge``, the run that trains (−1 for all) and its last sample (−1 for ``stop``),
        and how many infeasible draws came before.
        """
        drawn = np.array([draw.drawn for draw in self.members], dtype=float)
        variables: dict[str, Any] = {
            name: ("member", values, {"long_name": label, "units": unit_of(self.origin[name])})
            for (name, label), values in zip(DRAWN.items(), drawn.T, strict=True)
        }
        ridge = np.array([draw.settings.ridge for draw in self.members], dtype=float)
        variables["ridge"] = ("member", ridge, {"long_name": "ridge λ", "units": "1"})
        rows = [
            (each.window, each.state_delays, each.input_delays, draw.run, draw.last, draw.redrawn)
            for draw in self.members
            for each in (draw.settings,)
        ]
        for (name, label), column in zip(INTEGERS.items(), zip(*rows, strict=True), strict=True):
            values = np.array([-1 if each is None else each for each in column], dtype=np.int64)
            variables[name] = ("member", values, {"long_name": label, "units": "1"})
        attrs = {
            "ensemble": json.dumps(self.origin),
            "redrawn": sum(draw.redrawn for draw in self.members),
        }
        return xr.Dataset(variables, coords={"member": np.arange(self.n_members)}, attrs=attrs)

    @cached_property
    def training_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant of the training windows in each run that trains a member, s."""
        spans = dict[str, tuple[float, float]]()
        for run, arrays in enumerate(self.arrays):
            firsts, ends = [], []
            for draw in self._taught:
                if draw.run in (None, run):
                    whole, window = len(arrays.states), draw.settings.window
                    ends.append(whole - 1 if draw.last is None else draw.last - arrays.offset)
                    firsts.append(0 if window is None else ends[-1] - window + 1)
            if ends:
                begin = arrays.begin
                spans[arrays.name] = begin + min(firsts) * self.dt, begin + max(ends) * self.dt
        return spans

    @cached_property
    def read_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant that any member reads of each run, delay history included, s."""
        return {
            each.name: (each.begin, each.begin + (len(each.states) - 1) * self.dt)
            for each in self.arrays
            if len(each.states)
        }

    def free_runs(
        self, groups: Sequence[Windows], members: Sequence[int] = (0,)
    ) -> list[FloatArray]:
        """Free runs over groups of windows, each (member, window, steps, N), NaN where lost."""
        runs = [self.dynamics(number) for number in members]
        return linear_runs(runs, groups, self.signature.readouts)

    def system_matrices(self) -> Iterator[FloatArray]:
        """Â of each member."""
        return (self.dynamics(number).system for number in range(self.n_members))

    def dynamics(self, number: int) -> Dynamics:
        """What a free run of a member needs, or of what they are centred on: number n_members."""
        if self.identified:
            return self.identified[number]
        data, solution = self._identified(number)
        return Dynamics(solution.coefficients, data.signature)

    def member(self, number: int) -> HankelDMDcModel:
        """One member as a model of its own.

        Parameters
        ----------
        number : int
            Number of the member, from zero.

        Returns
        -------
        HankelDMDcModel
            Equal to :class:`HankelDMDc` with the member's settings and data: means and standard
            deviations are those of its own windows (paper, section System identification setup).

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
        data, solution = self._identified(number)
        return HankelDMDcModel(
            settings=self.members[number].settings,
            coefficients=solution.coefficients,
            signature=replace(data.signature, readouts=self.signature.readouts),
            training=data.training(solution),
            coverage=self.coverage,
        )

    def _identified(self, number: int) -> tuple[TrainingData, Solution]:
        """Training data and regression of a member."""
        draw = self._taught[number]
        arrays = self.arrays if draw.run is None else [self.arrays[draw.run]]
        data = member_data(arrays, draw.settings, draw.last, self.signature)
        return data, data.regress(draw.settings)

    def spectral_radii(
        self, *, executor: Executor | None = None, progress: Progress | None = None
    ) -> FloatArray:
        """Largest modulus of an eigenvalue of each member; a member is stable below one.

        Found once for an ensemble in memory; its file does not depend on it.

        Parameters
        ----------
        executor, progress
            As in :meth:`forecast`.

        Returns
        -------
        ndarray, shape (member,)

        Warns
        -----
        SeakeepWarning
            When they are found, if one or more are not below one.
        """
        if not self._radii:
            every = range(self.n_members)
            radii = np.array([*in_order(_spectral_radius, self, every, executor, progress)])
            radii.flags.writeable = False
            self._radii.append(radii)
            if unstable := int(np.count_nonzero(radii >= 1.0)):
                warn(
                    f"{unstable} of {counted(radii.size, 'member')} have a spectral radius of one "
                    f"or more (up to {radii.max():.6f}): a free run of theirs grows, and once it "
                    "is lost it is left out of mean and band. Raise the ridge, train on more "
                    "data, use shorter state delays, or look for transients at the ends of the "
                    "training runs."
                )
        return self._radii[0]

    @cached_property
    def _radii(self) -> list[FloatArray]:
        """Spectral radii, once they have been asked for."""
        return []

    def summary(self) -> str:
        """Text that describes the ensemble and the stability of its members.

        Returns
        -------
        str
            A few lines; the first reading finds the :meth:`spectral_radii`.
        """
        origin, settings, count = self.origin, self.settings, self.n_members
        refused = self.draws.attrs["redrawn"]
        scale = ", per snapshot pair" if settings.ridge_scale == "per_snapshot" else ""
        lines = [
            f"Ensemble of {counted(count, 'Hankel DMD model')} with control: "
            f"{counted(len(self.states), 'state')}, {counted(len(self.inputs), 'input')}, "
            f"dt {self.dt:g} s",
            f"  states        {', '.join(with_units(self.state_labels))}",
            f"  inputs        {', '.join(with_units(self.input_labels)) or 'none (autonomous)'}",
            f"  draws         {SAMPLING[origin['sampling']]}, seed {origin['seed']}; "
            f"{refused or 'none'} infeasible and drawn again",
            f"  window        {self._drawn('window')}",
            f"  state delay   {self._drawn('state_delays')}",
            f"  input delay   {self._drawn('input_delays')}",
            f"  ridge         {_range(self.draws.ridge.values, '.4g')}{scale}; delay rows "
            f"{'exact' if settings.delay_rows == 'exact' else 'regressed'}",
            f"  history       {self.history_samples} samples up to the start of a forecast",
            *self.signature.input_map.describe(self.dt),
            *(each.describe() for each in self.signature.readouts),
            f"  training      {counted(len(self.arrays), 'run')}"
            + (f", {TRAIN_ON[origin['train_on']]}" if len(self.arrays) > 1 else ""),
        ]
        lines += [
            f"    {name}: {span_text(*span, self.dt)}" for name, span in self.training_spans.items()
        ]
        if self.is_centred:
            lines.append("  centre        the mean is the single model of all runs")
        if self.selection:
            lines.append("  chosen        " + self.selection.replace("\n", "\n  "))
        if (calibration := self.calibration) is not None:
            margin, count_of = calibration.conformal, sum(calibration.windows.values())
            line = (
                f"  band          calibrated for {margin.level:g} on "
                f"{counted(count_of, 'window')} of {calibration.steps} steps: "
            )
            if calibration.floor is None:
                line += f"wider by {_range(margin.margin / self.state_spread, '.2g')} "
            else:
                what = "a learnt scale" if calibration.scale == "learnt" else "spread"
                line += (
                    f"{_range(margin.margin, '.2g')} times {what} and a floor of "
                    f"{_range(calibration.floor / self.state_spread, '.2g')} "
                )
            lines.append(line + "training SD either way")
        radii = self.spectral_radii()
        unstable = int(np.count_nonzero(radii >= 1.0))
        verdict = (
            f"{unstable} of {count} UNSTABLE: their long forecasts diverge"
            if unstable
            else "stable"
        )
        clipped = "" if settings.radius is None else f", clipped to {settings.radius:g}"
        lines.append(
            f"  stability     spectral radius {_range(radii, '.6f')}, median "
            f"{np.median(radii):.6f} ({verdict}{clipped})"
        )
        return "\n".join(lines)

    @property
    def state_spread(self) -> FloatArray:
        """Standard deviation of the states over all that members learn from, shape (N,)."""
        return self.signature.state_scale.spread

    def forecast(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        *,
        ahead: str = "refuse",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Free runs of all members.

        Parameters
        ----------
        run, start, steps, ahead
            As in :meth:`HankelDMDcModel.forecast`.
        executor : concurrent.futures.Executor, optional
            Executor that identifies and runs the members: :func:`seakeep.models.processes`, or
            Dask's ``client.get_executor()``; by default this process. The result does not depend on
            it.
        progress : callable, optional
            Called as ``progress(done, total, what)`` after each member.

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
        windows = self.read_windows(run, [start], steps, ahead)
        series, lost = self._series(windows, executor, progress)
        return self._single(run, windows, np.array(series[:, 0]), lost, "member")

    def _series(
        self, windows: Windows, executor: Executor | None, progress: Progress | None
    ) -> Series:
        """Series of all members, weighed where waves are predicted."""
        held = self
        # Weights take errors of all members, and what follows its surge is stepped together.
        if (windows.departures or windows.table is not None) and not self.identified:
            held = self.hold(executor=executor, progress=progress)
            progress = None  # the rest is a small part
        parts = member_series(held, [windows, *windows.departures], executor, progress)
        if windows.departures and held.errors is not None:
            runs, signature = [series for series, _ in parts], self.signature
            weigh_members(windows, runs, held.errors, signature.state_scale)
            for each in signature.readouts:  # what moved the members ends at a floor
                load = runs[0][..., each.column]
                np.maximum(load, each.floor, out=load)
        return parts[0]

    def forecast_summary(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        level: float = 0.95,
        *,
        band: Band = "members",
        ahead: str = "refuse",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Mean, standard deviation and band of the members, reduced piece by piece.

        Parameters
        ----------
        run, start, steps, ahead, executor, progress
            As in :meth:`forecast`.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band : {"members", "calibrated"}, optional
            Quantiles of the members, or the bounds that :meth:`calibrate` found.

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
        windows = self.read_windows(run, [start], steps, ahead)
        values, lost, statistic, counts = self._banded(windows, level, band, executor, progress)
        forecast = self._single(run, windows, values[0], lost, "statistic")
        return forecast.assign_coords(statistic=statistic).assign_attrs(counts)

    def _single(
        self,
        run: xr.Dataset,
        windows: Windows,
        values: FloatArray,
        lost: IntArray,
        dimension: str,
    ) -> xr.Dataset:
        """Dataset of one window: values of shape (members or statistics, steps, N)."""
        variables = label_channels(self.signature, values, (dimension, "time"))
        variables["status"] = ("member", statuses(lost, windows, self.signature.dt)[:, 0])
        time, gone = windows.time[0], lost[:, 0]
        words = {"units": "s", "long_name": "first instant at which the member is lost"}
        middle = values if dimension == "member" else values[:1]
        return xr.Dataset(
            variables,
            coords={
                "member": np.arange(self.n_members),
                "diverged_at": ("member", np.where(gone >= 0, time.values[gone], np.nan), words),
                "time": time,
            },
            attrs=forecast_attrs(
                self,
                run,
                windows,
                middle,
                diverged=int(np.count_nonzero(gone >= 0)),
                **self._facts,
            ),
        )

    def _of_members(self, forecast: xr.Dataset) -> xr.Dataset:
        """A forecast of all members, with their numbers and where they come from."""
        return forecast.assign_coords(member=np.arange(self.n_members)).assign_attrs(self._facts)

    @property
    def _facts(self) -> dict[str, Any]:
        """Attributes of each forecast: where the members come from, and how many they are."""
        return {"ensemble": json.dumps(self.origin), "members": self.n_members}

    def summarize_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        level: float = 0.95,
        *,
        band: Band = "members",
        ahead: str = "refuse",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Mean, standard deviation and band from several starts, reduced piece by piece.

        Parameters
        ----------
        run, starts, steps, ahead, executor, progress
            As in :meth:`forecast_windows`.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band
            As in :meth:`forecast_summary`.

        Returns
        -------
        Dataset
            Dimensions (window, statistic, lead); ``diverged`` counts over ``window``.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        windows = self.read_windows(run, starts, steps, ahead)
        values, lost, statistic, counts = self._banded(windows, level, band, executor, progress)
        diverged = ("window", (lost >= 0).sum(axis=0))
        forecast = windows_dataset(self.signature, windows, values, "statistic", diverged=diverged)
        return forecast.assign_coords(statistic=statistic).assign_attrs(self._facts | counts)

    def _banded(
        self,
        windows: Windows,
        level: float,
        band: Band,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> tuple[FloatArray, IntArray, xr.Variable, dict[str, Any]]:
        """Statistics (window, 4, steps, N) of all members, and where these were lost.

        Then the coordinate of the statistics, and attributes of the band.
        """
        level = fraction(level, "level")
        check_choice("band", band, get_args(Band))
        attrs: dict[str, Any] = {"level": level}
        bounds, calibrated = "", None
        if band == "calibrated":
            calibrated = calibrated_for(self.calibration, level)
            bounds, attrs["band"] = calibrated.bounds, band
        series, lost = self._series(windows, executor, progress)
        values = reduce_members(series, lost, level)
        if calibrated is not None:
            values = widened(calibrated, values, self.signature, windows)
        return values, lost, statistic_coordinate(level, bounds), attrs

    def hold(self, *, executor: Executor | None = None, progress: Progress | None = None) -> Self:
        """Identify all members once and keep them, for forecasts in a loop or on board.

        Parameters
        ----------
        executor, progress
            As in :meth:`forecast`.

        Returns
        -------
        HankelEnsemble
            The same, with members :attr:`identified`: N(N(s+1) + Q(z+1)) numbers per member with
            exact delay rows, and s + 1 times as many with regressed ones.
        """
        if self.identified:
            return self
        numbers = range(len(self._taught))
        members = in_order(HankelEnsemble.dynamics, self, numbers, executor, progress)
        return replace(self, identified=tuple(members))

    def forecast_arrays(
        self,
        x_history: npt.ArrayLike,
        u_history: npt.ArrayLike,
        u_future: npt.ArrayLike,
        steps: int,
        level: float = 0.95,
        *,
        band: Band = "members",
        ahead: str = "refuse",
    ) -> BandForecast:
        """Free runs of all members from arrays, reduced to mean and band.

        Parameters
        ----------
        x_history : array_like, shape (at least s + 1, N)
            States up to and including instant k, oldest first, physical units, in the order of
            ``ensemble.states``; s is the longest of a member (``ensemble.state_delays``).
        u_history : array_like, shape (at least z + 1, Q)
            Inputs up to and including instant k, in the order of ``ensemble.inputs``, aligned
            already if the ensemble aligns them; z likewise.
        u_future : array_like, shape (at least steps − 1 + lead_samples, Q)
            Inputs at k + 1, k + 2, …; shape (0, 0) for members without input.
        steps : int
            Number of instants.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band : {"members", "calibrated"}, optional
            As in :meth:`HankelEnsemble.forecast_summary`.
        ahead
            As in :meth:`HankelDMDcModel.forecast_arrays`.

        Returns
        -------
        BandForecast
            The numbers of :meth:`HankelEnsemble.forecast_summary`.

        Raises
        ------
        RequestError
            If a shape or name does not fit, or there is no such band.
        """
        windows = check_arrays(self.signature, x_history, u_history, u_future, steps, ahead)
        values, lost, *_ = self._banded(windows, level, band)
        mean, std, lower, upper = values[0]
        return BandForecast(mean, std, lower, upper, int(np.count_nonzero(lost >= 0)))

    @property
    def _serving(self) -> tuple[Self, list[Dynamics], LeadErrors | None]:
        """What forecasts in service, what its filter predicts with, and errors in training."""
        members = self.hold()
        return members, members._means, members.errors

    @property
    def _means(self) -> list[Dynamics]:
        """What the mean of the members is made of: all of them, or what they are centred on."""
        first = self.n_members if self.is_centred else 0
        return [self.dynamics(number) for number in range(first, len(self._taught))]

    @cached_property
    def errors(self) -> LeadErrors | None:
        """Errors of the members' mean on what they learnt from; None where that is too short."""
        signature = self.signature
        series: Any = ((each.states, each.delayed, each.direct) for each in self.arrays)
        first = signature.history_samples - 1
        if signature.input_map.reference:  # departures need no period before a start
            series = departing(series, signature.input_map)
            first = max(signature.state_delays, signature.input_delays)
        stretches = [Stretch(x, u, v, first, min(len(x) - 1, len(u))) for x, u, v in series]
        return linear_errors(self._means, stretches, signature.readouts)

    def _drawn(self, name: str) -> str:
        """A length as drawn, and in samples."""
        samples = self.draws[f"{name}_samples"].values
        if samples[0] < 0:
            return "all of a run"
        rounded = _of(_range(samples, "d"), "samples")
        drawn = self.draws[name]
        if drawn.attrs["units"] == "samples":
            return rounded
        return f"{_of(_range(drawn.values, '.4g'), drawn.attrs['units'])} ({rounded})"

    def calibrate(
        self,
        runs: Runs,
        steps: int,
        level: float = 0.95,
        *,
        scale: BandScale = "spread",
        folds: Literal["run"] | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> Self:
        r"""Make a band that holds unseen measurements as often as it states.

        The ensemble forecasts windows end to end in `runs` that no member has read, and a quantile
        of its errors there makes the band, channel by channel
        (:func:`seakeep.statistics.conformal_margin`, which says what that guarantees and what it
        does not).

        Parameters
        ----------
        runs : Dataset, sequence of Dataset, or mapping of names to Datasets
            Runs of the same sea, or parts of them, under the names by which they trained. Leave
            out what the ensemble is to be tested on.
        steps : int
            Instants of a window: as many as will be forecast.
        level : float, optional
            Probability that the band is to have.
        scale : {"spread", "constant", "learnt"}, optional
            ``"spread"``: the band is :math:`\mu \pm k \sqrt{\sigma^2 + (e/4)^2}`, with mean and
            standard deviation of the members at each instant, e the root mean square error of the
            mean in these windows, and k the quantile. ``"constant"``: the members' own band, moved
            outwards by as much at every instant. ``"learnt"``: the logarithm of the scale is
            regressed on spread, horizon and waves, cross-fitted over the runs, or over halves of
            the windows of a single one.
        folds : {"run"}, optional
            For runs that train, read to their ends: each is forecast by the same members as they
            learn from runs of other waves (from all other runs, where each repeats its waves), or a
            third of a single run as they learn from the rest of it; the margin goes to the members
            as they are. What the input map and the read-outs learnt, they learnt from all of them.
            Members that learn from the run alone, or whose window reaches into the third, are left
            out there.
        executor, progress
            As in :meth:`forecast`; a step is a member in one of the runs.

        Returns
        -------
        HankelEnsemble
            The same members, with the :attr:`calibration` that ``band="calibrated"`` uses.

        Raises
        ------
        RequestError
            If there is no such window, or a setting is out of range.
        DataError
            If a run cannot be used.
        """
        return replace(
            self,
            calibration=calibrate(self, runs, steps, level, scale, folds, executor, progress),
        )

    def without(self, run: str) -> HankelEnsemble:
        """The same draws as they learn from the other runs, to forecast a run that trained.

        Parameters
        ----------
        run : str
            Name of a run that trains.

        Returns
        -------
        HankelEnsemble
            Without the members that learn from that run alone; the input map is kept.

        Raises
        ------
        RequestError
            If no member is left, or no run of that name trains.
        """
        names = [each.name for each in self.arrays]
        if run not in names:
            raise RequestError(f"no run '{run}' trains. Those that do: {', '.join(names)}.")
        left_out = names.index(run)
        members = tuple(
            draw if draw.run is None or draw.run < left_out else replace(draw, run=draw.run - 1)
            for draw in self.members
            if len(names) > 1 and draw.run != left_out
        )
        if not members:
            raise RequestError(
                f"no member learnt from another run than '{run}', and none is left to forecast "
                "it. Train on several runs, or calibrate on a run that does not train."
            )
        arrays = self.arrays[:left_out] + self.arrays[left_out + 1 :]
        return replace(self, members=members, arrays=arrays, calibration=None, identified=())

    def without_part(self, begin: int, end: int) -> HankelEnsemble:
        """The same draws as they learn from the rest of the one run that trains.

        Parameters
        ----------
        begin, end : int
            Samples of what members read: the first that is left out, and the next that is not.

        Returns
        -------
        HankelEnsemble
            With the members whose window does not reach into the part; the input map is kept.

        Raises
        ------
        RequestError
            If no member is left.
        """
        (every,) = self.arrays
        whole, arrays = every.offset + len(every.states), every.without(begin, end, self.dt)
        members = [replace(draw, run=None) for draw in self.members if draw.settings.window is None]
        for draw in (each for each in self.members if each.settings.window is not None):
            first = draw.first(0, whole, self.signature.input_map)
            last = whole - 1 if draw.last is None else draw.last
            members += [
                replace(draw, run=number, last=last)
                for number, each in enumerate(arrays)
                if each.offset <= first and last < each.offset + len(each.states)
            ]
        if not members:
            raise RequestError(
                "the windows of all members reach into each third of the run, and none is left "
                "to forecast it. Train with shorter windows or on several runs, or calibrate on "
                "a run that does not train."
            )
        return replace(
            self,
            members=tuple(members),
            arrays=tuple(arrays),
            calibration=None,
            identified=(),
        )

    def to_dataset(self) -> xr.Dataset:
        """The ensemble as a Dataset: what :meth:`save` writes."""
        parts = store.pack({name: getattr(self, name) for name in KEPT})
        return self.draws.assign(parts.data_vars).assign_attrs(parts.attrs)


def _spectral_radius(ensemble: HankelEnsemble, number: int) -> float:
    return spectral_radius(ensemble.dynamics(number))


def _range(values: Sequence[float] | FloatArray, form: str) -> str:
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _of(count: str, unit: str) -> str:
    return f"{count} {unit.removesuffix('s') if count == '1' else unit}"


def child(seed: np.random.SeedSequence, member: int) -> np.random.Generator:
    """Generator of a member: the child of `seed` with its number, without changing `seed`."""
    key = (*seed.spawn_key, member)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def draw_members(spec: Any, dt: float, samples: Sequence[int], input_map: InputMap) -> list[Draw]:
    """Draw the settings of all members.

    Parameters
    ----------
    spec : BayesianHankelDMDc
        Priors, seed and rules; imports of its room run the other way.
    dt : float
        Time step, s.
    samples : sequence of int
        Samples of each run up to its stop.
    input_map : InputMap
        Says what history and look-ahead it takes.

    Returns
    -------
    list of Draw
        One per member.

    Raises
    ------
    DataError
        If a member finds no feasible draw in a thousand.
    """
    seed, shared = spec.seed_sequence, spec.shared(dt)
    points = np.empty((spec.n_members, 0))
    if spec.sampling == "sobol":
        scrambling = np.random.default_rng(seed)
        engine = scipy.stats.qmc.Sobol(len(PRIORS), scramble=True, rng=scrambling)
        # A power of two, the balance of which the net keeps; the first n_members are used.
        points = engine.random_base2(max(spec.n_members - 1, 1).bit_length())
    return [
        _draw_member(spec, shared, dt, samples, input_map, child(seed, number), points[number])
        for number in range(spec.n_members)
    ]


def _draw_member(
    spec: Any,
    shared: HankelSettings,
    dt: float,
    samples: Sequence[int],
    input_map: InputMap,
    generator: np.random.Generator,
    point: FloatArray,
) -> Draw:
    refused = ""
    for redrawn in range(MOST_REDRAWS):
        quantiles = point if point.size and not redrawn else generator.random(len(PRIORS))
        drawn = {
            name: x
            for name, q in zip(PRIORS, quantiles, strict=True)
            if (x := spec.at(name, float(q))) is not None
        }
        if wrong := [f"{name} = {x}" for name, x in drawn.items() if not np.isfinite(x)]:
            refused = (
                f"the last one gave {wrong[0]}. Check the parameters of that prior, or give it "
                "bounds."
            )
            continue
        own: Json = {
            name: x if name == "ridge" else spec.samples(name, x, dt) for name, x in drawn.items()
        }
        if refused := _out_of_range(own, shared.history):
            continue
        with quiet():  # given when the priors were made
            settings = replace(shared, **own)
        lengths = drawn.get("window", np.nan), drawn["state_delays"], drawn["input_delays"]
        draw = Draw(settings, lengths, redrawn=redrawn)
        needed = draw.needed(input_map)
        run = None if spec.train_on == "all" else int(generator.integers(len(samples)))
        if (min(samples) if run is None else samples[run]) < needed:
            refused = (
                f"the shortest run has {min(samples)} samples up to stop, and the last draw asked "
                f"for {needed} (window {settings.window}, delays {settings.state_delays} and "
                f"{settings.input_delays}). Give longer runs or a later stop, or narrow the priors."
            )
            continue
        if run is None:
            return draw
        last = samples[run] - 1
        if spec.train_on == "windows":
            last = int(generator.integers(needed - 1, samples[run]))
        return replace(draw, run=run, last=last)
    raise DataError(f"no feasible draw in {MOST_REDRAWS}: {refused}")


def _out_of_range(own: Json, history: History) -> str:
    """What is wrong with a draw for any runs; empty where nothing is."""
    s, z = own["state_delays"], own["input_delays"]
    for name in PRIORS[1:]:
        if own[name] < 0:
            return (
                f"the last one gave {name} = {own[name]:.6g}, which is negative. Move the prior "
                "above zero."
            )
    inside = history == "inside"
    least = max(s, z) + 2 if inside else 2
    if "window" in own and own["window"] < least:
        within = f" with delays of {s} and {z} inside it" if inside else ""
        return (
            f"the last one gave a window of {own['window']} samples{within}, and {least} are "
            "needed. Raise window, or lower the delays."
        )
    return ""


INTEGERS = {
    "window_samples": "length of the training window; −1 for all of a run",
    "state_delays_samples": "number of delayed copies of the states",
    "input_delays_samples": "number of delayed copies of the inputs",
    "training_run": "run that trains; −1 for all",
    "last_sample": "last sample of the training window; −1 for that at stop",
    "redrawn": "infeasible draws before this one",
}


def draws_of(dataset: xr.Dataset, shared: HankelSettings) -> tuple[Draw, ...]:
    """Rebuild draws from those of a file and what all members share."""
    columns = (dataset[name].values.tolist() for name in ("ridge", *INTEGERS))
    rows = zip(*columns, strict=True)
    drawn = zip(*(dataset[name].values.tolist() for name in DRAWN), strict=True)
    members = []
    with quiet():  # given when the priors were made
        for lengths, (ridge, window, s, z, run, last, redrawn) in zip(drawn, rows, strict=True):
            length, number, end = (None if each < 0 else each for each in (window, run, last))
            settings = replace(shared, ridge=ridge, window=length, state_delays=s, input_delays=z)
            members.append(Draw(settings, lengths, number, end, redrawn))
    return tuple(members)
