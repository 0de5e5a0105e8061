"""Choice between a surge that the model predicts and none, by validation on training data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.metrics import anrmse
from seakeep.errors import DataError
from seakeep.models import labelled
from seakeep.models.alignment import ProbeAlignment, Surge
from seakeep.models.identification import Stop, check_names, until
from seakeep.models.labelled import Runs, as_runs
from seakeep.signals import encounter_period

if TYPE_CHECKING:
    from seakeep.models.hankel import HankelDMDc

__all__ = ["AlignmentChoice", "choose_alignment"]

FloatArray = npt.NDArray[np.float64]

CANDIDATES: tuple[Surge, ...] = ("predicted", "none")
PERIODS = 15
"""Length of a forecast, the paper's for irregular waves."""
MOST_FOLDS, MOST_WINDOWS = 4, 24
"""Bounds of the cost: models that are fitted for each candidate, and forecasts of each."""
HELD_OUT = 1 / 3
"""Part of a single run that is forecast by a model of what comes before it."""


@dataclass(frozen=True)
class AlignmentChoice:
    """What validation on training data says of the alignment.

    Parameters
    ----------
    alignment : ProbeAlignment
        The better one.
    errors : mapping of str to ndarray, each shape (window,)
        ANRMSE of each validation window with surge "predicted" and "none"; infinite where a
        forecast diverged.
    windows : tuple of (str, float)
        Run and start (s) of each window.
    steps : int
        Samples forecast in each.
    """

    alignment: ProbeAlignment
    errors: Mapping[str, FloatArray] = field(repr=False)
    windows: tuple[tuple[str, float], ...] = field(repr=False)
    steps: int

    @property
    def medians(self) -> dict[str, float]:
        """Median ANRMSE over the windows, by surge."""
        return {name: float(np.median(each)) for name, each in self.errors.items()}

    @property
    def difference(self) -> float:
        """Median over the windows of the error with surge "predicted" less that with "none"."""
        return _difference(self.errors)

    def describe(self) -> str:
        """Both figures and the choice, as one line."""
        told = " and ".join(f"{value:.3f} with surge '{k}'" for k, value in self.medians.items())
        better = int(np.sum(self.errors["predicted"] < self.errors["none"]))
        return (
            f"surge '{self.alignment.surge}': median ANRMSE {told} over {len(self.windows)} "
            f"windows of training data (median paired difference {self.difference:+.3f}, "
            f"'predicted' the better one in {better})"
        )


def choose_alignment(
    spec: HankelDMDc,
    runs: Runs,
    states: Sequence[str],
    inputs: Sequence[str],
    stop: Stop = None,
    steps: int | None = None,
) -> AlignmentChoice:
    """Choose between ``surge="predicted"`` and ``surge="none"`` on training data alone.

    Of several runs each in turn (at most four) is forecast by a model of the others, of a single
    run its last third by a model of what comes before. Both candidates forecast the same windows,
    which do not overlap, at most 24 in all; the sign of the median paired difference of their
    ANRMSE decides, for "none", which is cheaper, where it is zero.

    Parameters
    ----------
    spec : HankelDMDc
        Settings of the model; its alignment gives mode, celerity and channels, and without one
        linear dispersion is used. What its `surge` says does not count.
    runs : Dataset, sequence of Dataset, or mapping of names to Datasets
        Training runs.
    states, inputs : sequence of str
        As for :meth:`HankelDMDc.fit`; the surge is among the states.
    stop : float, sequence or mapping of float, optional
        Last instant of training, s; nothing after it is read.
    steps : int, optional
        Samples of a forecast; by default 15 encounter periods, or what the data held out leave
        if that is less.

    Returns
    -------
    AlignmentChoice
        The alignment, for ``dataclasses.replace(spec, alignment=choice.alignment)``, and the
        errors of both.

    Raises
    ------
    RequestError
        As :meth:`HankelDMDc.fit`.
    DataError
        As :meth:`HankelDMDc.fit`; also if the data held out are too short for a forecast of one
        encounter period, or have gaps in every window.
    """
    check_names(states, inputs)
    named = until(as_runs(runs), stop)
    base = spec.alignment or ProbeAlignment(mode="dispersion")
    dt = labelled.run_step(next(iter(named.values())), next(iter(named)))
    history = spec.history_samples
    period = _period(named, inputs, dt)
    wanted = max(round(PERIODS * period / dt), 1) if steps is None else steps
    folds = _folds(named, history)
    longest = max(held.sizes["time"] for _, _, held in folds) - history
    length = min(wanted, longest)
    if length * dt < period:
        raise DataError(
            f"the alignment cannot be chosen: the data held out of training leave {length} "
            f"samples after a history of {history}, less than one encounter period ({period:.3g} "
            "s). Give longer runs, more runs, or shorter delays."
        )
    found: dict[str, list[float]] = {surge: [] for surge in CANDIDATES}
    windows: list[tuple[str, float]] = []
    share = max(MOST_WINDOWS // len(folds), 1)
    for name, training, held in folds:
        starts = _starts(held, [*states, *inputs], history, length, share)
        windows += [(name, start) for start in starts]
        for surge in CANDIDATES if starts else ():
            candidate = replace(spec, alignment=replace(base, surge=surge))
            model = candidate.fit(training, states, inputs)
            spread = model.state_scale.spread
            for start in starts:
                forecast = model.forecast(held, start=start, steps=length)
                measured = held.sel(time=forecast["time"].values)
                found[surge].append(_error(forecast, measured, states, spread))
    if not windows:
        raise DataError(
            "the alignment cannot be chosen: every window of the data held out of training has "
            "gaps. Bridge them in [preparation], or give other runs."
        )
    errors = {surge: np.array(values) for surge, values in found.items()}
    chosen = replace(base, surge="predicted" if _difference(errors) < 0 else "none")
    return AlignmentChoice(chosen, errors, tuple(windows), length)


def _difference(errors: Mapping[str, FloatArray]) -> float:
    predicted, none = errors["predicted"], errors["none"]
    lost = np.isinf(predicted) & np.isinf(none)
    return float(np.median(np.subtract(predicted, none, out=np.zeros_like(none), where=~lost)))


def _period(runs: Mapping[str, xr.Dataset], inputs: Sequence[str], dt: float) -> float:
    """Encounter period that the runs state, or that of the first input."""
    name, run = next(iter(runs.items()))
    stated = run.attrs.get("encounter_period")
    if stated is not None:
        return float(stated)
    wave = labelled.channel_matrix(run, list(inputs)[:1], name)[:, 0]
    return encounter_period(wave[np.isfinite(wave)], dt)


def _folds(
    runs: Mapping[str, xr.Dataset], history: int
) -> list[tuple[str, dict[str, xr.Dataset], xr.Dataset]]:
    """Name, training runs and held-out data of each fold."""
    if len(runs) == 1:
        name, run = next(iter(runs.items()))
        cut = round((1.0 - HELD_OUT) * run.sizes["time"])
        before = max(cut - history, 0)  # a forecast's history may reach into what trains
        held = run.isel(time=slice(before, None))
        return [(name, {name: run.isel(time=slice(0, cut))}, held)]
    names = list(runs)
    chosen = np.unique(np.linspace(0, len(names) - 1, min(MOST_FOLDS, len(names))).round())
    return [
        (names[int(i)], {other: runs[other] for other in names if other != names[int(i)]},
         runs[names[int(i)]])
        for i in chosen
    ]  # fmt: skip


def _starts(
    held: xr.Dataset, channels: Sequence[str], history: int, length: int, most: int
) -> list[float]:
    """Starts of windows that have no gaps and do not overlap, at most so many, spread evenly."""
    sound = np.all(np.isfinite(held[list(channels)].to_dataframe()[list(channels)].values), axis=1)
    time = held["time"].values
    places = [
        at
        for at in range(history - 1, time.size - length, length)
        if sound[at + 1 - history : at + length + 1].all()
    ]
    if len(places) > most:
        places = [places[int(i)] for i in np.linspace(0, len(places) - 1, most).round()]
    return [float(time[at]) for at in places]


def _error(
    forecast: xr.Dataset, measured: xr.Dataset, states: Sequence[str], spread: FloatArray
) -> float:
    predicted, true = (
        np.stack([each[name].values for name in states], axis=1) for each in (forecast, measured)
    )
    if not np.all(np.isfinite(predicted)):
        return float("inf")
    return float(anrmse(predicted=predicted, measured=true, training_std=spread))
