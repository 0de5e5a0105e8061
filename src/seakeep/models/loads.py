"""Read-outs fitted: loads by the wave at their lines, where that is better than none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, IntArray
from seakeep.core import metrics
from seakeep.core.readouts import KNOTS, MARGIN, LoadMap, best_place, floor_of, sums, weights_of
from seakeep.errors import RequestError
from seakeep.models import labelled
from seakeep.models.following import PER_WAVE
from seakeep.models.readouts import FittedReadOut, ReadOut, ReadOutKind
from seakeep.models.training import TrainingData

PERIODS = 15.0
"""Length of the free runs that judge a read-out, encounter periods."""
COARSE = 4
"""Places of the carriers' grid between two of the first scan for a line."""
WORST = 10.0
"""NRMSE at which a window counts no worse."""
SURE = 2.0
"""Standard errors by which a read-out must be better than none."""
LEAST = 0.02
"""Part of the error that it must gain: a load that is linear in the motions stays a state."""


@dataclass(frozen=True, eq=False)
class Held:
    """Free runs on a training run, by the model of the other runs.

    Parameters
    ----------
    run : int
        The run, by its place among those that train.
    starts : ndarray of int, shape (window,)
        Samples of its training arrays from which they start.
    predicted, measured : ndarray, shape (window, steps, N)
        Physical units.
    """

    run: int
    starts: IntArray
    predicted: FloatArray
    measured: FloatArray


def fit_readouts(
    readouts: Sequence[ReadOut],
    data: TrainingData,
    runs: Mapping[str, xr.Dataset],
    judged: Sequence[Held],
) -> tuple[FittedReadOut, ...]:
    """Fit read-outs.

    Parameters
    ----------
    readouts : sequence of ReadOut
        What is wanted.
    data : TrainingData
        Of the training windows.
    runs : mapping of str to Dataset
        The runs that these are cut from.
    judged : sequence of Held
        Cross-fitted forecasts, for those whose kind is to be chosen; may be empty.

    Returns
    -------
    tuple of FittedReadOut

    Raises
    ------
    RequestError
        If waves are not carried to the predicted surge, and the kind is "wave".
    """
    names = [label.name for label in data.state_labels]
    states = [data.state_scale.physical(values) for values in data.states]
    windows = zip(states, data.windows, strict=True)
    seen = np.concatenate([values[window.samples] for values, window in windows])
    waves, follows, out = _Waves(data, runs, {}), data.input_map.follows, []
    for each in readouts:
        column, columns = names.index(each.channel), [names.index(name) for name in each.of]
        floor, units = floor_of(seen, seen[:, column], columns), data.state_labels[column].units
        kind: ReadOutKind = "none" if each.kind == "auto" else each.kind
        scores: dict[str, float] = {}
        load = None
        if follows is not None:
            columns = [follows.column, *(c for c in columns if c != follows.column)]
            line = _Line(waves, states, column, columns)
            if each.kind == "auto":
                kind, scores = line.chosen(judged, floor)
            if kind == "wave":
                load = line.map(range(len(states)))
        elif kind == "wave":
            raise RequestError(
                f"readouts: {each.channel}: kind = 'wave' reads waves that are carried to the "
                "surge which the model predicts. Set alignment mode = 'dispersion', surge = "
                "'predicted', or take kind = 'auto'."
            )
        out.append(FittedReadOut(each.channel, each.of, kind, column, units, scores, floor, load))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Waves at places about the vessel, at the samples of the training arrays.

    Parameters
    ----------
    data, runs
        As for :func:`fit_readouts`.
    at : dict
        Elevation and rate in each run, shape (time, 2), by place in steps of the carriers' grid.
    """

    data: TrainingData
    runs: Mapping[str, xr.Dataset]
    at: dict[int, list[FloatArray]]

    @property
    def spacing(self) -> float:
        """Step of the places, m."""
        assert self.data.input_map.follows is not None
        return self.data.input_map.follows.place.spacing

    def find(self, places: Sequence[int]) -> None:
        """Make those of some places known."""
        new = [place for place in places if place not in self.at]
        every = [self._in_run(run, new) for run in range(len(self.data.names))] if new else []
        for number, place in enumerate(new):
            self.at[place] = [values[:, number] for values in every]

    def _in_run(self, number: int, places: Sequence[int]) -> FloatArray:
        """Waves of a run, shape (time, place, 2); NaN where its record does not tell them."""
        data, name = self.data, self.data.names[number]
        follows, run = data.input_map.follows, self.runs[name]
        assert follows is not None
        values = labelled.channel_matrix(run, [label.name for label in data.input_labels], name)
        time = np.asarray(run["time"].values, dtype=float)
        begin = data.first_instants[number] - data.windows[number].first * data.dt
        # The row of a sample is the wave an instant after the step that leads to it starts.
        offset = labelled.nearest_sample(time, begin, name) - 1
        count = len(data.states[number])
        first = max(offset, follows.back)
        stop = min(offset + count, len(values) - follows.ahead)
        out = np.full((count, len(places), 2), np.nan)
        drive = data.input_map.drive(values, [], run=run)
        at = tuple(place * self.spacing for place in places)
        out[first - offset : stop - offset] = drive.waves(at, first, stop)
        return out


class _Line:
    """A load, and the sums of its regressions at the places that were looked at.

    Parameters
    ----------
    waves : _Waves
        Waves of training.
    states : sequence of ndarray, each of shape (time, N)
        States of training.
    column : int
        Place of the load among them.
    columns : list of int
        Places of surge and other motions.
    """

    def __init__(
        self, waves: _Waves, states: Sequence[FloatArray], column: int, columns: list[int]
    ) -> None:
        self.waves, self.states, self.column, self.columns = waves, states, column, columns
        self.sums: dict[int, FloatArray] = {}
        self._scan(range(-PER_WAVE, PER_WAVE + 1, COARSE))
        best = self._best(range(len(states)))
        self._scan(range(best - COARSE + 1, best + COARSE))

    def _pieces(self, place: int) -> list[FloatArray]:
        """Motions, wave and load of each run, shape (sample, len(columns) + 3)."""
        out = []
        for window, states, wave in zip(
            self.waves.data.windows, self.states, self.waves.at[place], strict=True
        ):
            parts = [states[:, self.columns], wave, states[:, [self.column]]]
            every = np.concatenate(parts, axis=1)[window.first_column + 1 : window.last + 1]
            out.append(every[np.isfinite(every).all(axis=1)])
        return out

    def _moments(self, place: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Means and standard deviations of motions and wave, and knots of the surge."""
        pooled = np.concatenate(self._pieces(place))[:, :-1]
        mean, std = pooled.mean(axis=0), pooled.std(axis=0, ddof=1)
        return mean, std, np.quantile((pooled[:, 0] - mean[0]) / std[0], KNOTS)

    def _scan(self, places: Sequence[int]) -> None:
        """Take sums at some places, of each run."""
        self.waves.find(places)
        for place in places:
            mean, std, knots = self._moments(place)
            self.sums[place] = np.stack(
                [
                    sums((each[:, :-1] - mean) / std, each[:, -1], knots)
                    for each in self._pieces(place)
                ]
            )

    def _best(self, runs: Sequence[int]) -> int:
        """Place of the line as some runs tell it."""
        every = np.stack(list(self.sums.values()))
        return list(self.sums)[best_place(every[:, list(runs)])]

    def map(self, runs: Sequence[int]) -> LoadMap:
        """The load as some runs tell it."""
        place = self._best(runs)
        mean, std, knots = self._moments(place)
        pieces = self._pieces(place)
        seen = np.concatenate([pieces[run] for run in runs])
        low, high = seen.min(axis=0), seen.max(axis=0)
        margin = MARGIN * (high[-1] - low[-1])
        return LoadMap(
            place * self.waves.spacing,
            self.column,
            self.columns,
            mean,
            std,
            low[:-1],
            high[:-1],
            knots,
            weights_of(self.sums[place][list(runs)].sum(axis=0)),
            np.array([low[-1] - margin, high[-1] + margin]),
        )

    def chosen(self, windows: Sequence[Held], floor: float) -> tuple[ReadOutKind, dict[str, float]]:
        """The kind that is best on each run in turn, as the other runs teach it, and the scores."""
        errors: dict[str, list[FloatArray]] = {"none": [], "wave": []}
        for each in windows if len(windows) > 1 else ():
            load = self.map([run for run in range(len(self.states)) if run != each.run])
            wave = self.waves.at[round(load.place / self.waves.spacing)][each.run]
            at = each.starts[:, None] + np.arange(1, each.measured.shape[1] + 1)
            linear = each.predicted[..., self.column]
            for kind, read in (("none", linear), ("wave", load(each.predicted, wave[at]))):
                error = metrics.nrmse(
                    predicted=np.maximum(read, floor)[..., None],
                    measured=each.measured[..., [self.column]],
                    training_std=self.waves.data.state_scale.spread[[self.column]],
                )
                errors[kind].append(np.minimum(error[:, 0], WORST))
        none, wave = (np.concatenate([np.empty(0), *each]) for each in errors.values())
        sound = np.isfinite(none) & np.isfinite(wave)
        if not sound.any():
            return "none", {}
        scores = {"none": float(none[sound].mean()), "wave": float(wave[sound].mean())}
        gain = (none - wave)[sound]
        doubt = float(gain.std(ddof=1)) / len(gain) ** 0.5 if len(gain) > 1 else np.inf
        least = max(SURE * doubt, LEAST * scores["none"])
        return ("wave" if gain.mean() > least else "none"), scores
