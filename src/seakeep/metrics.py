"""Error measures of a forecast, for arrays and for Datasets.

All take ``predicted=`` and ``measured=`` by keyword, in the same units. Arrays are ``(…, time,
channel)``. With Datasets the channels of `predicted` are judged at its instants, each against the
variable of the same name in `measured`; text, such as the status of an ensemble's members, is not
judged. DataFrames over an index ``time``, and DataArrays with a dimension of names, are taken as
Datasets. Measures per channel return a Dataset of numbers. A channel whose measured standard
deviation in the window is below 1 % of its training standard deviation (a slack line), or more than
half of whose variance is noise, is NaN and left out of averages; forecasts carry the training
standard deviation in the attribute ``training_std`` of each channel, prepared runs that of the
noise in ``noise_std``.

With ``interval=0.95`` a measure gives the bounds of its interval instead of its value, along a
first axis (lower, upper; of Datasets the dimension ``bound``). Predicted and measured samples are
redrawn together in blocks as long as what errors and measurement add to the NRMSE depends on
itself (Politis and White), with the same draws for the same call; Student's distribution accounts
for few blocks. The interval states the uncertainty of the value for a longer record of this run
and this model. For the uncertainty over runs and training sets see
:func:`seakeep.statistics.two_way_interval`. Extremes (NAMMAE) are redrawn from the measured ones,
so that their bounds are rough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import update_wrapper
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep import pairing
from seakeep.arrays import BoolArray, FloatArray, as_real, fraction, undefined
from seakeep.core.bootstrap import block_length, bootstrap_indices, student_interval
from seakeep.errors import RequestError, quiet

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

SLACK_PART = 0.01
"""A channel whose measured SD is below this part of its training SD is not judged."""
NOISE_FACTOR = 2**0.5
"""Nor is one whose measured SD is below so many SDs of its noise: more than half of its variance
is noise there, which no model forecasts."""


class Pair(NamedTuple):
    """Two histories, the measured SD, and which channels are judged.

    The SD is NaN where a channel is slack or noise, and where the measurement has a gap; the first
    two are not judged, the third is (and found to be NaN). `least` is the SD below which a channel
    is not judged.
    """

    p: FloatArray
    m: FloatArray
    least: FloatArray
    spread: FloatArray
    judged: BoolArray


def paired(
    predicted: object,
    measured: object,
    training_std: npt.ArrayLike | None = None,
    noise_std: npt.ArrayLike | None = None,
) -> Pair:
    """Check two histories, and say which channels are judged."""
    p, m = as_real(predicted, "predicted"), as_real(measured, "measured")
    if m.ndim == 1 and p.shape[-1:] == m.shape:
        p, m = p[..., None], m[:, None]
    if m.ndim < 2 or p.shape[-2:] != m.shape[-2:]:
        hint = " One of them looks transposed." if m.ndim == 2 and p.shape == m.shape[::-1] else ""
        raise RequestError(
            f"predicted has shape {p.shape} and measured {m.shape}; both must end in "
            f"(time, channel) of the same size.{hint}"
        )
    if m.shape[-2] < 2:
        raise RequestError(
            f"a window of {m.shape[-2]} sample(s) has no standard deviation; judge at least two."
        )
    least = np.zeros(m.shape[-1])
    known = (("training_std", training_std, SLACK_PART), ("noise_std", noise_std, NOISE_FACTOR))
    for name, given, part in known:
        if given is not None:
            least = np.fmax(least, part * as_real(given, name))
    return pair_of(p, m, least)


def pair_of(p: FloatArray, m: FloatArray, least: FloatArray) -> Pair:
    """A pair of histories (…, time, channel) that are known to fit."""
    spread = m.std(axis=-2, ddof=1)
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    slack = (spread <= 1e-12 * np.abs(m).max(axis=-2)) | (spread < least)
    return Pair(p, m, least, np.where(slack, np.nan, spread), ~slack)


def slack_share(load: FloatArray, noise_std: float) -> float:
    """Part of the samples at which a line is slack: its load is not above the SD of its noise.

    A sixth of the noise lies above it, and waves that just leave the line slack count as slack: the
    two about cancel, to 5 % of the samples in the virtual tank.

    Parameters
    ----------
    load : ndarray, shape (time,)
        Load of a line, which only pulls.
    noise_std : float
        Standard deviation of its noise, as :func:`seakeep.signals.waves.noise_floor` estimates it.

    Returns
    -------
    float
        From 0 to 1.
    """
    return float(np.mean(load <= noise_std))


def root_mean_square(error: FloatArray) -> FloatArray:
    """Root mean square over time."""
    return np.sqrt(np.mean(error**2, axis=-2))


def extremes_error(pair: Pair) -> FloatArray:
    """Mean absolute error of minimum and maximum over time, in measured SDs."""
    low = np.abs(pair.p.min(axis=-2) - pair.m.min(axis=-2))
    high = np.abs(pair.p.max(axis=-2) - pair.m.max(axis=-2))
    return 0.5 * (low + high) / pair.spread


def over_channels(values: FloatArray, judged: BoolArray) -> FloatArray:
    """Average over the judged channels; a diverged one, or one with a gap, is not left out."""
    judged = np.broadcast_to(judged, values.shape)
    count = judged.sum(axis=-1)
    total = np.where(judged, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


BOUNDS = ("lower", "upper")
REDRAWN = 300
"""Redrawn records of an interval."""
AT_ONCE = 2_000_000
"""Values of redrawn records at a time."""

Measure = Callable[..., Any]
"""A measure of arrays, whose result is numbers, and of Datasets, whose result has labels."""
OfPair = Callable[[Pair], npt.NDArray[Any]]


def labelled(
    keeps: Literal["channel", "time", "neither"], units: str = "1", label: str | None = None
) -> Callable[[OfPair], Measure]:
    """Let a measure of a pair of arrays take arrays and Datasets by keyword, and an interval.

    Parameters
    ----------
    keeps : {"channel", "time", "neither"}
        Which of the last two axes of the pair its result still has: of Datasets it is a Dataset, a
        DataArray over time, or a number.
    units, label : str, optional
        Unit of the result, and what it is called in a long name; by default the function's name.

    Returns
    -------
    callable
        Decorator of a function of :class:`seakeep.metrics.Pair`.
    """

    def decorate(of: OfPair) -> Measure:
        name = label or of.__name__

        def measure(
            *,
            predicted: npt.ArrayLike | xr.Dataset,
            measured: npt.ArrayLike | xr.Dataset,
            training_std: npt.ArrayLike | None = None,
            noise_std: npt.ArrayLike | None = None,
            interval: float | None = None,
        ) -> Any:
            sides = pairing.named_sides(predicted=predicted, measured=measured)
            if interval is not None and keeps == "time":
                raise RequestError(
                    f"{name} has a value at each instant, and no interval over time."
                )
            if not sides:
                values = _valued(of, paired(predicted, measured, training_std, noise_std), interval)
                return values if values.ndim else values.item()
            pairs, pair = _paired(**sides, training_std=training_std, noise_std=noise_std)
            values = _valued(of, pair, interval)
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
            first = sides["predicted"]
            coords |= {dim: first[dim] for dim in dims if dim in first.coords}
            return xr.DataArray(
                values, coords, dims, of.__name__, {"units": units, "long_name": name}
            )

        # Not its annotations: the arguments of a function of a pair are others.
        update_wrapper(measure, of, ("__module__", "__name__", "__qualname__", "__doc__"))
        del measure.__wrapped__  # type: ignore[attr-defined]
        return measure

    return decorate


def _paired(
    predicted: xr.Dataset, measured: Any, training_std: Any = None, noise_std: Any = None
) -> tuple[pairing.Paired, Pair]:
    """Channels of two Datasets, with the standard deviations that are given or that they carry."""
    pairs = pairing.pair(predicted=predicted, measured=measured)
    known = {"training_std": training_std, "noise_std": noise_std}
    for key, data in zip(known, (predicted, measured), strict=True):
        if known[key] is None:
            known[key] = [data[each].attrs.get(key, 0.0) for each in pairs.names]
    return pairs, paired(**pairs.arrays, **known)


def _valued(of: OfPair, pair: Pair, level: float | None) -> FloatArray:
    """A measure, or its bounds over redrawn blocks of instants, shape (2, …)."""
    value = np.asarray(of(pair))
    if level is None:
        return value
    if value.dtype == bool:
        raise RequestError(f"{of.__name__} says yes or no, and has no interval.")
    tails, block = fraction(level, "interval"), _block(pair)
    redrawn, blocks = _redrawn(of, pair, block), pair.m.shape[-2] / block
    return np.stack(student_interval(value, redrawn, blocks, tails, _axis_of_draws(pair)))


def _axis_of_draws(pair: Pair) -> int:
    """Behind members and windows, in the place of time."""
    return max(pair.p.ndim, pair.m.ndim) - 2


def _block(pair: Pair) -> int:
    """Instants over which those parts of an NRMSE depend on each other that are redrawn."""
    p, m = pair.p, pair.m
    error, apart = (p - m) ** 2, (m - m.mean(axis=-2, keepdims=True)) ** 2
    with undefined():
        square, variance = (each.mean(axis=-2, keepdims=True) for each in (error, apart))
        # Twice what an instant adds to the ratio of error and spread.
        parts = np.sqrt(square / variance) * (error / square - apart / variance)
    parts = np.where(np.isfinite(parts), parts, 0.0).sum(axis=-1)
    series = parts.reshape(-1, p.shape[-2]).mean(axis=0)
    with quiet():  # few blocks widen the interval
        return 1 if np.ptp(series) == 0 else block_length(series, "politis_white")


def _redrawn(of: OfPair, pair: Pair, block: int, seed: int = 0) -> FloatArray:
    """A measure over redrawn blocks of instants; draws lie on the axis of time."""
    p, m, least = pair.p, pair.m, pair.least
    rows = bootstrap_indices(m.shape[-2], REDRAWN, block, np.random.default_rng(seed))
    # Standard deviations of each window are those of all of its draws.
    least = least[..., None, :] if least.ndim > 1 else least
    step = max(1, AT_ONCE // max(p.size, m.size))
    pieces = [rows[first : first + step] for first in range(0, REDRAWN, step)]
    return np.concatenate(
        [of(pair_of(p[..., at, :], m[..., at, :], least)) for at in pieces], _axis_of_draws(pair)
    )


@labelled("channel", label="slackness")
def is_slack(pair: Pair) -> BoolArray:
    """Say which channels are not judged, because the measurement barely moves or is noise.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray of bool, shape (channel,), or Dataset
        True for a channel whose measured SD is below 1 % of its training SD, or below √2 times
        that of its noise, or zero.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.

    Examples
    --------
    >>> import numpy as np
    >>> measured = np.stack([np.sin(np.arange(9)), np.zeros(9)], axis=1)
    >>> is_slack(predicted=measured, measured=measured)
    array([False,  True])
    """
    return ~pair.judged


@labelled("channel", label="NRMSE")
def nrmse(pair: Pair) -> FloatArray:
    """Root mean square error of each channel, divided by its measured standard deviation.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training, by default the ones that a forecast carries; a channel
        whose measured SD is below 1 % of it (a slack line) is NaN.
    noise_std : array_like, shape (…, channel), optional
        Standard deviations of the noise, by default the ones that prepared runs carry
        (:func:`seakeep.signals.waves.noise_floor`); a channel more than half of whose measured
        variance is noise is NaN.
    interval : float, optional
        Probability, such as 0.95, between bounds that take the place of the value: a first axis,
        or dimension ``bound``, of lower and upper (:mod:`seakeep.metrics` says how they are drawn).

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        NRMSE (the summand of the paper's ANRMSE, k = 1, SD with ddof = 1 over the window). A
        forecast that diverged (NaN) gives NaN too.

    Raises
    ------
    RequestError
        If shapes or channels do not fit, or the window has fewer than two samples.
    DataError
        If the instants or units of two Datasets differ.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0, 20, 400)
    >>> measured = np.stack([np.sin(t), np.cos(t)], axis=1)
    >>> nrmse(predicted=0.9 * measured, measured=measured).round(2)
    array([0.1, 0.1])
    """
    return root_mean_square(pair.p - pair.m) / pair.spread


@labelled("neither")
def anrmse(pair: Pair) -> FloatArray:
    """Average of :func:`nrmse` over the channels that can be judged (paper, equation ANRMSE).

    Parameters
    ----------
    predicted, measured, training_std, noise_std, interval
        As for :func:`nrmse`.

    Returns
    -------
    float, or an array over the leading axes
        NaN if no channel can be judged, or the forecast diverged.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return _anrmse(pair)


@labelled("time", label="error in measured standard deviations")
def error_over_time(pair: Pair) -> FloatArray:
    """Error at each instant in measured SDs, averaged over the channels: ε(t) of the paper.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, time), or DataArray

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return over_channels(
        np.abs(pair.p - pair.m) / pair.spread[..., None, :], pair.judged[..., None, :]
    )


@labelled("channel", label="NAMMAE")
def normalised_extremes_error(pair: Pair) -> FloatArray:
    """Mean absolute error of minimum and maximum of each channel, in measured SDs.

    Parameters
    ----------
    predicted, measured, training_std, noise_std, interval
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        The summand of :func:`nammae`.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return extremes_error(pair)


@labelled("neither")
def nammae(pair: Pair) -> FloatArray:
    """Normalised average minimum/maximum absolute error (paper, equation NAMMAE).

    Parameters
    ----------
    predicted, measured, training_std, noise_std, interval
        As for :func:`nrmse`.

    Returns
    -------
    float, or an array over the leading axes
        Average of :func:`normalised_extremes_error` over the channels that can be judged.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return over_channels(extremes_error(pair), pair.judged)


@labelled("channel", "%", "fit")
def fit_percent(pair: Pair) -> FloatArray:
    r"""Fit of each channel as MATLAB's ``compare`` states it, percent.

    Parameters
    ----------
    predicted, measured, training_std, noise_std, interval
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        :math:`100 (1 - \|y - \hat y\| / \|y - \bar y\|)`: 100 is perfect, 0 is no better than
        the mean, negative is worse.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    norm = np.sqrt(np.sum((pair.p - pair.m) ** 2, axis=-2))
    return 100.0 * (1.0 - norm / (pair.spread * np.sqrt(pair.m.shape[-2] - 1)))


def _anrmse(pair: Pair) -> FloatArray:
    return over_channels(root_mean_square(pair.p - pair.m) / pair.spread, pair.judged)


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
        pairs = [_paired(each, truth)[1] for each in forecasts]
        own = [_block(each) for each in pairs]
        values.append([_anrmse(each) for each in pairs])
        alone = [_redrawn(_anrmse, each, n) for each, n in zip(pairs, own, strict=True)]
        shared = [_redrawn(_anrmse, each, max(own), seed) for each in pairs]
        lost = np.isnan(values[-1])[:, None]
        draws.append(np.where(lost, np.nan, [alone, shared]))
        blocks.append(pairs[0].m.shape[-2] / np.array([own, [max(own)] * len(own)]))
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
    own = np.array(
        [student_interval(*one, level, -1) for one in zip(values, alone, blocks[0], strict=True)]
    )
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
