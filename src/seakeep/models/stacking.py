"""Read-outs fitted: on measured states, or on cross-fitted forecasts, or whichever is better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core import metrics
from seakeep.core.readouts import LinearHinges, fit_hinges, floor_of, knots_of, resting
from seakeep.errors import DataError
from seakeep.models.readouts import FittedReadOut, ReadOut, ReadOutKind
from seakeep.models.training import TrainingData

PERIODS = 15.0
"""Length of the free runs that a stacked read-out learns from, encounter periods."""
RIDGE = 1e-2
"""λ per sample on standardised states and hinges."""
LOST = 10.0
"""A free run that is this many times as far from the mean as training ever was teaches nothing."""
WORST = 10.0
"""NRMSE at which a window counts no worse."""
SURE = 2.0
"""Standard errors by which a read-out must be better than none: a linear channel stays linear."""
ORDER: tuple[ReadOutKind, ...] = ("none", "hinge", "stacked")


@dataclass(frozen=True, eq=False)
class Held:
    """Free runs on a training run, by the model of the other runs.

    Parameters
    ----------
    run : int
        The run, by its place among those that train.
    predicted, measured : ndarray, shape (window, steps, N)
        Standardised deviations.
    """

    run: int
    predicted: FloatArray
    measured: FloatArray


def fit_readouts(
    readouts: Sequence[ReadOut], data: TrainingData, judged: Sequence[Held]
) -> tuple[FittedReadOut, ...]:
    """Fit read-outs.

    Parameters
    ----------
    readouts : sequence of ReadOut
        What is wanted.
    data : TrainingData
        Measured states of the training windows, standardised.
    judged : sequence of Held
        Cross-fitted forecasts; may be empty where no read-out is stacked.

    Returns
    -------
    tuple of FittedReadOut

    Raises
    ------
    DataError
        If a stacked one has no forecast to learn from.
    """
    names = [label.name for label in data.state_labels]
    measured = [
        values[window.samples] for values, window in zip(data.states, data.windows, strict=True)
    ]
    reach = LOST * np.abs(np.concatenate(measured)).max(axis=0)
    fitted = []
    for each in judged:
        sound = np.all(np.abs(each.predicted) <= reach, axis=(1, 2))
        if np.any(sound):
            fitted.append(Held(each.run, each.predicted[sound], each.measured[sound]))
    return tuple(_fitted(each, data, names, measured, fitted) for each in readouts)


def _fitted(
    readout: ReadOut,
    data: TrainingData,
    names: list[str],
    measured: list[FloatArray],
    judged: list[Held],
) -> FittedReadOut:
    target, columns = names.index(readout.channel), [names.index(name) for name in readout.of]
    if readout.kind == "auto":
        kind, scores = _chosen(target, columns, measured, judged)
    else:
        kind, scores = readout.kind, {}
    if kind == "stacked" and not judged:
        raise DataError(
            f"readouts: {readout.channel}: a stacked read-out learns from free runs of "
            f"{PERIODS:g} encounter periods on training runs that are held out, and none fits. "
            "Give longer or more runs, or take kind = 'hinge' or 'auto'."
        )
    seen, scale = np.concatenate(measured), data.state_scale
    floor = floor_of(seen, seen[:, target], columns)
    learnt = _learnt(kind, target, columns, seen, floor, judged)
    function = None if learnt is None else learnt.rescaled(scale.mean, scale.std, target)
    units = data.state_labels[target].units
    return FittedReadOut(readout.channel, readout.of, kind, target, units, scores, function)


def _learnt(
    kind: ReadOutKind,
    target: int,
    columns: list[int],
    seen: FloatArray,
    floor: float,
    judged: list[Held],
) -> LinearHinges | None:
    """Read-out of standardised states; None where the forecast stays as it is."""
    if kind == "none":
        return resting(target, floor) if np.isfinite(floor) else None
    states, channel, linear = seen, seen[:, target], columns
    if kind == "stacked":
        linear = list(range(seen.shape[1]))
        states = np.concatenate([each.predicted.reshape(-1, len(linear)) for each in judged])
        channel = np.concatenate([each.measured[..., target].ravel() for each in judged])
    knots = knots_of(states, columns)
    return fit_hinges(states, channel, linear, columns, knots, RIDGE, floor)


def _chosen(
    target: int, columns: list[int], measured: list[FloatArray], windows: list[Held]
) -> tuple[ReadOutKind, dict[str, float]]:
    """The kind that is best on each run in turn, as the other runs teach it, and the scores."""
    errors: dict[str, list[FloatArray]] = {kind: [] for kind in ORDER}
    for each in windows if len(windows) > 1 else ():
        others = np.concatenate([x for run, x in enumerate(measured) if run != each.run])
        floor = floor_of(others, others[:, target], columns)
        taught = [other for other in windows if other.run != each.run]
        for kind in ORDER:
            read = _learnt(kind, target, columns, others, floor, taught)
            predicted = each.predicted[..., target] if read is None else read(each.predicted)
            error = metrics.nrmse(
                predicted=predicted[..., None],
                measured=each.measured[..., [target]],
                training_std=np.ones(1),
            )
            errors[kind].append(np.minimum(error[:, 0], WORST))
    scores = {kind: np.concatenate(each) for kind, each in errors.items() if each}
    judged = {kind: each[np.isfinite(each)] for kind, each in scores.items()}
    if not judged or not len(judged["none"]):
        return "none", {}
    means = {kind: float(each.mean()) for kind, each in judged.items()}
    best = ORDER[0]
    for kind in ORDER[1:]:
        gain = judged["none"] - judged[kind]
        doubt = float(gain.std(ddof=1)) / len(gain) ** 0.5 if len(gain) > 1 else np.inf
        if gain.mean() > SURE * doubt and means[kind] < means[best]:
            best = kind
    return best, means
