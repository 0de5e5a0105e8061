"""Read-outs fitted: loads by the wave at their lines, where that is better than none."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from seakeep import metrics
from seakeep.arrays import Datasets, FloatArray, IntArray
from seakeep.core.readouts import KNOTS, MARGIN, LoadMap, best_place, floor_of, sums, weights_of
from seakeep.errors import RequestError
from seakeep.models import labelled
from seakeep.models.alignment import PER_WAVE
from seakeep.models.readouts import Asked, FittedReadOut, ReadOutKind, motions_of
from seakeep.models.training import TrainingData

PERIODS = 15.0
"""Length of the free runs that judge a read-out, encounter periods."""
STEP, REACH = 2, PER_WAVE // 2
"""Step of the scan for a line, in places of the carriers' grid, and steps to either side: a length
of the peak's wave. Half of the gain is lost 0.3 m off the line, on tanks with waves of 4 m."""
WORST = 10.0
"""NRMSE at which a window counts no worse."""
STANDARD_ERRORS = 2.0
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
    readouts: Mapping[str, Asked],
    data: TrainingData,
    runs: Datasets,
    held: Iterable[Held],
) -> tuple[FittedReadOut, ...]:
    """Fit read-outs.

    Parameters
    ----------
    readouts : mapping of str to str
        Kind that is wanted of each channel.
    data : TrainingData
        Of the training windows.
    runs : mapping of str to Dataset
        The runs that these are cut from.
    held : iterable of Held
        Cross-fitted forecasts, for those whose kind is to be chosen; may be empty.

    Returns
    -------
    tuple of FittedReadOut

    Raises
    ------
    RequestError
        If waves are not carried to the predicted surge, and the kind is "wave".
    """
    signature = data.signature
    states = [signature.state_scale.physical(values) for values in data.states]
    windows = zip(states, data.windows, strict=True)
    parts = [values[window.samples] for values, window in windows]
    seen, of_run = np.concatenate(parts), np.repeat(range(len(parts)), [*map(len, parts)])
    follows, out = signature.input_map.follows, []
    judged = [] if follows is None else [*held]
    places, waves = np.zeros(0), []
    if follows is not None:
        step = STEP * follows.place.spacing
        # About the probe, or whole lengths of the wave from it where the vessel is.
        lengths = round(follows.place.centre / step / REACH)
        places = step * (REACH * lengths + np.arange(-REACH, REACH + 1.0))
        waves = [_waves(data, runs, number, places) for number in range(len(states))]
    for channel, asked in readouts.items():
        column = signature.states.index(channel)
        columns = motions_of(signature.state_labels, channel)
        units, floor = signature.state_labels[column].units, -math.inf
        if not signature.input_map.reference:  # departures from each run's means have none
            floor = floor_of(seen, seen[:, column], columns, of_run)
        kind: ReadOutKind = "none" if asked == "auto" else asked
        scores: dict[str, float] = {}
        load = None
        if follows is not None:
            columns = [follows.column, *(c for c in columns if c != follows.column)]
            line = _Line(data, states, waves, places, column, columns)
            if asked == "auto":
                kind, scores = _chosen(line, judged, floor)
            if kind == "wave":
                load = line.map(range(len(states)))
        elif kind == "wave":
            raise RequestError(
                f"readouts: {channel} = 'wave' reads waves that are carried to the "
                "surge which the model predicts. Set alignment mode = 'dispersion', surge = "
                "'predicted', or write 'auto'."
            )
        out.append(FittedReadOut(channel, kind, column, units, scores, floor, load))
    return tuple(out)


def _waves(data: TrainingData, runs: Datasets, number: int, places: FloatArray) -> FloatArray:
    """Elevation and rate at places about the vessel at the training samples of a run.

    Shape (time, place, 2); NaN where the record does not tell them.
    """
    name, input_map = data.names[number], data.signature.input_map
    follows = input_map.follows
    assert follows is not None
    run = runs[name]
    values = labelled.channel_matrix(run, data.signature.inputs, name)
    time = run["time"].values.astype(float)
    # The wave of a sample is that an instant after the one from which the step to it starts.
    offset = labelled.nearest_sample(time, data.begin(number), name) - 1
    count = len(data.states[number])
    first = max(offset, follows.back)
    stop = min(offset + count, len(values) - follows.ahead)
    out = np.full((count, len(places), 2), np.nan)
    drive = input_map.drive(values, [], run=run)
    out[first - offset : stop - offset] = drive.waves(tuple(places.tolist()), first, stop)
    return out


class _Line:
    """A load, and the sums of its regressions at all places.

    Parameters
    ----------
    data : TrainingData
        As for :func:`fit_readouts`.
    states : sequence of ndarray, each of shape (time, N)
        States of training, physical units.
    waves : sequence of ndarray, each of shape (time, place, 2)
        Waves of training.
    places : ndarray, shape (place,)
        Where they are, m.
    column : int
        Place of the load among the states.
    columns : list of int
        Places of surge and other motions.
    """

    def __init__(
        self,
        data: TrainingData,
        states: Sequence[FloatArray],
        waves: Sequence[FloatArray],
        places: FloatArray,
        column: int,
        columns: list[int],
    ) -> None:
        self.waves, self.places, self.column, self.columns = waves, places, column, columns
        self.spread = data.signature.state_scale.spread[[column]]
        # Of each run: motions and load, shape (sample, …), and waves, shape (place, sample, 2).
        self.pieces = []
        for window, x, wave in zip(data.windows, states, waves, strict=True):
            inside = slice(window.first_column + 1, window.last + 1)
            known, seen = x[inside, [*columns, column]], wave[inside]
            sound = np.isfinite(seen).all(axis=(1, 2))
            self.pieces.append((known[sound], seen[sound].swapaxes(0, 1)))
        moments, products = [], []
        for at in range(len(places)):
            values = [self._read(run, at) for run in range(len(self.pieces))]
            every = np.concatenate(values)[:, :-1]
            mean, std = every.mean(axis=0), every.std(axis=0, ddof=1)
            # Of the surge, which is the same wherever the line is.
            self.knots = np.quantile((every[:, 0] - mean[0]) / std[0], KNOTS)
            moments.append((mean, std))
            products.append(
                [sums((each[:, :-1] - mean) / std, each[:, -1], self.knots) for each in values]
            )
        self.moments, self.sums = np.array(moments), np.array(products)

    def _read(self, run: int, at: int) -> FloatArray:
        """Motions, wave and load of a run with the line at a place, shape (sample, …)."""
        known, seen = self.pieces[run]
        return np.column_stack([known[:, :-1], seen[at], known[:, -1]])

    def map(self, runs: Sequence[int]) -> LoadMap:
        """The load as some runs tell it."""
        products = self.sums[:, list(runs)]
        at = best_place(products)
        mean, std = self.moments[at]
        seen = np.concatenate([self._read(run, at) for run in runs])
        low, high = seen.min(axis=0), seen.max(axis=0)
        margin = MARGIN * (high[-1] - low[-1])
        return LoadMap(
            float(self.places[at]),
            self.column,
            self.columns,
            mean,
            std,
            low[:-1],
            high[:-1],
            self.knots,
            weights_of(products[at].sum(axis=0)),
            np.array([low[-1] - margin, high[-1] + margin]),
        )


def _chosen(
    line: _Line, judged: Sequence[Held], floor: float
) -> tuple[ReadOutKind, dict[str, float]]:
    """The kind that is best on each run in turn, as the other runs teach it, and the scores."""
    errors = []
    for each in judged if len(judged) > 1 else ():
        load = line.map([run for run in range(len(line.waves)) if run != each.run])
        at = each.starts[:, None] + np.arange(1, each.measured.shape[1] + 1)
        wave = line.waves[each.run][at, int(np.argmin(np.abs(line.places - load.place)))]
        both = np.stack([each.predicted[..., line.column], load(each.predicted, wave)])
        error = metrics.nrmse(
            predicted=np.maximum(both, floor)[..., None],
            measured=each.measured[..., [line.column]],
            training_std=line.spread,
        )
        errors.append(np.minimum(error[..., 0], WORST))
    every = np.concatenate([np.empty((2, 0)), *errors], axis=1)
    none, wave = every[:, np.isfinite(every).all(axis=0)]
    if not none.size:
        return "none", {}
    scores = {"none": float(none.mean()), "wave": float(wave.mean())}
    gain = none - wave
    doubt = float(gain.std(ddof=1)) / len(gain) ** 0.5 if len(gain) > 1 else np.inf
    least = max(STANDARD_ERRORS * doubt, LEAST * scores["none"])
    return ("wave" if gain.mean() > least else "none"), scores
