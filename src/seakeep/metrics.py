"""Error measures of a forecast, for arrays and for Datasets.

All take ``predicted=`` and ``measured=`` by keyword, in the same units. Arrays are
``(…, time, channel)``. With Datasets the channels of `predicted` are judged at its instants, each
against the variable of the same name in `measured`; text, such as the status of an ensemble's
members, is not judged. Measures per channel return a Dataset of numbers. A channel whose
measured standard deviation in the window is below 1 % of its training standard deviation (a slack
line), or more than half of whose variance is noise, is NaN and left out of averages; forecasts
carry the training standard deviation in the attribute ``training_std`` of each channel, prepared
runs that of the noise in ``noise_std``.

With ``interval=0.95`` a measure gives the bounds of its interval instead of its value, along a
first axis (lower, upper; of Datasets the dimension ``bound``). Predicted and measured samples are
redrawn together in blocks as long as what errors and measurement add to the NRMSE depends on
itself (Politis and White), with the same draws for the same call; Student's distribution accounts
for few blocks. The interval states the uncertainty of the value for a longer record of this run
and this model. For the uncertainty over runs and training sets see
:func:`seakeep.statistics.two_way_interval`. Extremes (NAMMAE) are redrawn from the measured ones,
so that their bounds are rough.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray, fraction, undefined
from seakeep.core import metrics as core
from seakeep.core.bootstrap import block_length, bootstrap_indices, student_interval
from seakeep.errors import RequestError, quiet
from seakeep.pairing import Paired, pair

__all__ = [
    "Measure",
    "anrmse",
    "anrmse_differences",
    "error_over_time",
    "fit_percent",
    "is_slack",
    "labelled",
    "nammae",
    "normalised_extremes_error",
    "nrmse",
]

BOUNDS = ("lower", "upper")
REDRAWN = 300
"""Redrawn records of an interval."""
AT_ONCE = 2_000_000
"""Values of redrawn records at a time."""

Measure = Callable[..., Any]
"""A measure of arrays, whose result is numbers, and of Datasets, whose result has labels."""


def labelled(
    measure: Callable[..., Any],
    keeps: Literal["channel", "time", "neither"],
    units: str = "1",
    label: str | None = None,
) -> Measure:
    """Let a measure of arrays take Datasets too.

    Parameters
    ----------
    measure : callable
        Of arrays ``predicted=``, ``measured=`` (…, time, channel), ``training_std=`` and
        ``noise_std=``; :func:`seakeep.core.metrics.paired` checks them.
    keeps : {"channel", "time", "neither"}
        Which of its last two axes the result still has: of Datasets it is a Dataset, a DataArray
        over time, or a number.
    units, label : str, optional
        Unit of the result, and what it is called in a long name; by default the function's name.

    Returns
    -------
    callable
        The measure, under the name and docstring of the one of arrays.
    """
    name = label or measure.__name__

    @functools.wraps(measure)
    def judged(
        *,
        predicted: Any,
        measured: Any,
        training_std: Any = None,
        noise_std: Any = None,
        interval: float | None = None,
    ) -> Any:
        if isinstance(predicted, xr.Dataset) != isinstance(measured, xr.Dataset):
            raise RequestError(
                "predicted and measured must both be Datasets or both be arrays; received "
                f"{type(predicted).__name__} and {type(measured).__name__}."
            )
        if interval is not None and keeps == "time":
            raise RequestError(f"{name} has a value at each instant, and no interval over time.")

        if not isinstance(predicted, xr.Dataset):
            known = {"training_std": training_std, "noise_std": noise_std}
            arrays = {"predicted": predicted, "measured": measured}
            values = _valued(measure, arrays, known, interval)
            return values if values.ndim else values.item()
        pairs, known = _paired(predicted, measured, training_std, noise_std)
        values = _valued(measure, pairs.arrays, known, interval)
        coords: dict[str, Any] = {} if interval is None else {"bound": list(BOUNDS)}
        dims = (*coords, *pairs.lead)
        if keeps == "channel":
            return xr.Dataset(
                {
                    each: (
                        dims[: values.ndim - 1],
                        values[..., column],
                        {"units": units, "long_name": f"{name} of {each}"},
                    )
                    for column, each in enumerate(pairs.names)
                },
                coords=coords,
            )
        if values.ndim == 0:
            return values.item()
        dims += ("time",) * (keeps == "time")
        coords |= {dim: predicted[dim] for dim in dims if dim in predicted.coords}
        attrs = {"units": units, "long_name": name}
        return xr.DataArray(values, coords, dims, name=measure.__name__, attrs=attrs)

    judged.__module__ = __name__
    return judged


def _paired(
    predicted: xr.Dataset, measured: xr.Dataset, training_std: Any = None, noise_std: Any = None
) -> tuple[Paired, dict[str, Any]]:
    """Arrays of two Datasets, and the standard deviations that are given or that they carry."""
    pairs = pair(predicted=predicted, measured=measured)
    known = {"training_std": training_std, "noise_std": noise_std}
    for key, data in zip(known, (predicted, measured), strict=True):
        if known[key] is None:
            known[key] = [data[each].attrs.get(key, 0.0) for each in pairs.names]
    return pairs, known


def _valued(
    measure: Callable[..., Any],
    arrays: Mapping[str, Any],
    known: Mapping[str, Any],
    level: float | None,
) -> Any:
    """A measure, or its bounds over redrawn blocks of instants, shape (2, …)."""
    value = np.asarray(measure(**arrays, **known))
    if level is None:
        return value
    if value.dtype == bool:
        raise RequestError(f"{measure.__name__} says yes or no, and has no interval.")
    p, m, _, _ = core.paired(**arrays)
    tails, block = fraction(level, "interval"), _block(p, m)
    axis = max(p.ndim, m.ndim) - 2  # of the draws, behind members and windows
    redrawn = _redrawn(measure, p, m, known, block)
    return np.stack(student_interval(value, redrawn, m.shape[-2] / block, tails, axis))


def _block(p: FloatArray, m: FloatArray) -> int:
    """Instants over which those parts of an NRMSE depend on each other that are redrawn."""
    error, apart = (p - m) ** 2, (m - m.mean(axis=-2, keepdims=True)) ** 2
    with undefined():
        square, variance = (each.mean(axis=-2, keepdims=True) for each in (error, apart))
        # Twice what an instant adds to the ratio of error and spread.
        parts = np.sqrt(square / variance) * (error / square - apart / variance)
    parts = np.where(np.isfinite(parts), parts, 0.0).sum(axis=-1)
    series = parts.reshape(-1, p.shape[-2]).mean(axis=0)
    with quiet():  # few blocks widen the interval
        return 1 if np.ptp(series) == 0 else block_length(series, "politis_white")


def _redrawn(
    measure: Callable[..., Any],
    p: FloatArray,
    m: FloatArray,
    known: Mapping[str, Any],
    block: int,
    seed: int = 0,
) -> FloatArray:
    """A measure over redrawn blocks of instants; draws lie on the axis of time."""
    rows = bootstrap_indices(m.shape[-2], REDRAWN, block, np.random.default_rng(seed))
    # Standard deviations of each window are those of all of its draws.
    known = {key: np.asarray(each)[..., None, :] if np.ndim(each) > 1 else each
             for key, each in known.items()}  # fmt: skip
    step = max(1, AT_ONCE // max(p.size, m.size))
    pieces = [rows[first : first + step] for first in range(0, REDRAWN, step)]
    return np.concatenate(
        [measure(predicted=p[..., at, :], measured=m[..., at, :], **known) for at in pieces],
        max(p.ndim, m.ndim) - 2,
    )


def anrmse_differences(
    predicted: Sequence[Sequence[xr.Dataset]],
    measured: Sequence[xr.Dataset],
    interval: float = 0.95,
) -> xr.Dataset:
    """Compare the ANRMSE of several models over the same runs, paired with the first model.

    Parameters
    ----------
    predicted : sequence of sequence of Dataset
        Forecasts, per model and run.
    measured : sequence of Dataset
        Measurement of each run.
    interval : float, optional
        Probability between the bounds.

    Returns
    -------
    Dataset
        Over (model, run): ``anrmse``, ``change`` (relative to the first model, −0.2 for 20 %
        less) and its bounds ``lower`` and ``upper``; also ``anrmse_lower`` and ``anrmse_upper``.
        The same over ``model`` for the mean over the runs, as ``all_anrmse``, ``all_change`` and
        so on. For a change both models are redrawn in the same blocks of instants, so that errors
        that they share cancel; the bounds of an ANRMSE are those of :func:`anrmse`, with blocks
        of its model. The bounds hold for these runs: they do not contain the spread between runs.

    Raises
    ------
    RequestError, DataError
        As :func:`anrmse`.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> rng = np.random.default_rng(0)
    >>> heave = xr.Dataset({"heave": ("time", rng.normal(size=500))})
    >>> near, far = heave + 0.1 * rng.normal(size=500), heave + 0.2 * rng.normal(size=500)
    >>> found = anrmse_differences([[far], [near]], [heave])
    >>> bool(-0.6 < found["lower"][1, 0] < found["upper"][1, 0] < -0.4)
    True
    """
    level = fraction(interval, "interval")
    draws, values, blocks = [], [], []  # per run; of each model with its own blocks, and paired
    for seed, (truth, *forecasts) in enumerate(zip(measured, *predicted, strict=True)):
        pairs = [_paired(each, truth) for each in forecasts]
        cases = [(of.arrays["predicted"], of.arrays["measured"], known) for of, known in pairs]
        own = [_block(p, m) for p, m, _ in cases]
        values.append([core.anrmse(predicted=p, measured=m, **k) for p, m, k in cases])
        alone = [_redrawn(core.anrmse, *case, n) for case, n in zip(cases, own, strict=True)]
        shared = [_redrawn(core.anrmse, *case, max(own), seed) for case in cases]
        lost = np.isnan(values[-1])[:, None]
        draws.append(np.where(lost, np.nan, [alone, shared]))
        blocks.append(cases[0][1].shape[-2] / np.array([own, [max(own)] * len(own)]))
    runs = [_with_bounds(*each, level) for each in zip(values, draws, blocks, strict=True)]
    over_runs = {key: np.stack([run[key] for run in runs], axis=-1) for key in runs[0]}
    # The same draws of another run, in another order.
    others = [[np.roll(of[0], k, axis=-1), of[1]] for k, of in enumerate(draws)]
    pooled = _with_bounds(
        np.mean(values, axis=0), np.mean(others, axis=0), np.sum(blocks, axis=0), level
    )
    return xr.Dataset(
        {key: (("model", "run"), values) for key, values in over_runs.items()}
        | {f"all_{key}": (("model",), values) for key, values in pooled.items()},
        attrs={"level": level},
    )


def _with_bounds(
    anrmse: npt.ArrayLike, redrawn: FloatArray, blocks: FloatArray, level: float
) -> dict[str, FloatArray]:
    """ANRMSE of each model, its change from the first model, and the bounds of both.

    `redrawn` and `blocks` are those of each model alone, and those that all models share.
    """
    values, (alone, shared) = np.asarray(anrmse), redrawn
    each = zip(values, alone, blocks[0], strict=True)
    own = np.array([student_interval(*one, level, -1) for one in each])
    changes = student_interval(_ratio(values), _ratio(shared), blocks[1][0], level, -1)
    return {
        "anrmse": values,
        "anrmse_lower": own[:, 0],
        "anrmse_upper": own[:, 1],
        "change": _ratio(values) - 1.0,
        **{key: bound - 1.0 for key, bound in zip(BOUNDS, changes, strict=True)},
    }


def _ratio(values: FloatArray) -> FloatArray:
    """Ratio to the first entry; one for the first itself."""
    with undefined():
        return values / values[0]


is_slack = labelled(core.is_slack, "channel", label="slackness")
nrmse = labelled(core.nrmse, "channel", label="NRMSE")
normalised_extremes_error = labelled(core.normalised_extremes_error, "channel", label="NAMMAE")
fit_percent = labelled(core.fit_percent, "channel", "%", "fit")
anrmse = labelled(core.anrmse, "neither")
nammae = labelled(core.nammae, "neither")
error_over_time = labelled(
    core.error_over_time, "time", label="error in measured standard deviations"
)
