"""Error measures of a forecast, for arrays and for Datasets.

All take ``predicted=`` and ``measured=`` by keyword, in the same units. Arrays are
``(…, time, channel)``. With Datasets the channels of `predicted` are judged at its instants, each
against the variable of the same name in `measured`; words, such as the status of an ensemble's
members, are no channels. Per-channel measures come back as a Dataset of numbers. A channel whose
measured standard deviation in the window is below 1 % of its training standard deviation (a slack
line) is NaN and left out of averages; forecasts carry the training standard deviation in the
attribute ``training_std`` of each channel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core import metrics as core
from seakeep.errors import RequestError
from seakeep.pairing import pair

__all__ = [
    "anrmse",
    "error_over_time",
    "fit_percent",
    "is_slack",
    "nammae",
    "normalised_extremes_error",
    "nrmse",
]

Histories = npt.ArrayLike | xr.Dataset
Measure = Callable[..., npt.NDArray[Any]]


def _apply(
    measure: Measure, predicted: Histories, measured: Histories, training_std: npt.ArrayLike | None
) -> tuple[Any, list[str], tuple[str, ...]]:
    if isinstance(predicted, xr.Dataset) != isinstance(measured, xr.Dataset):
        raise RequestError(
            "predicted and measured must both be Datasets or both be arrays; received "
            f"{type(predicted).__name__} and {type(measured).__name__}."
        )
    if isinstance(predicted, xr.Dataset) and isinstance(measured, xr.Dataset):
        pairs = pair(predicted=predicted, measured=measured)
        if training_std is None:
            told = [predicted[name].attrs.get("training_std", 0.0) for name in pairs.names]
            training_std = np.array(told, dtype=float)
        return measure(**pairs.arrays, training_std=training_std), pairs.names, pairs.lead
    result = measure(predicted=predicted, measured=measured, training_std=training_std)
    return result, [], ()


def _per_channel(
    measure: Measure,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None,
    units: str,
    label: str,
) -> Any:
    values, names, lead = _apply(measure, predicted, measured, training_std)
    if not names:
        return values
    return xr.Dataset(
        {
            name: (lead, values[..., column], {"units": units, "long_name": f"{label} of {name}"})
            for column, name in enumerate(names)
        }
    )


def is_slack(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Say which channels are not judged, because the measurement hardly moves.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    ndarray of bool, shape (channel,), or Dataset
        True for a channel whose measured SD is below 1 % of its training SD, or zero.

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants of two Datasets differ.

    Examples
    --------
    >>> import numpy as np
    >>> measured = np.stack([np.sin(np.arange(9)), np.zeros(9)], axis=1)
    >>> is_slack(predicted=measured, measured=measured)
    array([False,  True])
    """
    values, names, lead = _apply(core.is_slack, predicted, measured, training_std)
    if not names:
        return values
    dims = lead[: values.ndim - 1]
    return xr.Dataset({name: (dims, values[..., column]) for column, name in enumerate(names)})


def nrmse(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Root mean square error of each channel in measured standard deviations.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        NRMSE (the summand of the paper's ANRMSE, k = 1, SD with ddof = 1 over the window).

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
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
    return _per_channel(core.nrmse, predicted, measured, training_std, "1", "NRMSE")


def normalised_extremes_error(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Error of minimum and maximum of each channel in measured standard deviations.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        The summand of the paper's NAMMAE.

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants or units of two Datasets differ.
    """
    return _per_channel(
        core.normalised_extremes_error, predicted, measured, training_std, "1", "NAMMAE"
    )


def fit_percent(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Fit of each channel as MATLAB's ``compare`` states it.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        Percent: 100 is perfect, 0 no better than the mean.

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants or units of two Datasets differ.
    """
    return _per_channel(core.fit_percent, predicted, measured, training_std, "%", "fit")


def anrmse(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Average of :func:`nrmse` over the channels that can be judged (paper, eq. ANRMSE).

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    float, or an array over the leading axes

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants or units of two Datasets differ.
    """
    values, _, lead = _apply(core.anrmse, predicted, measured, training_std)
    if values.ndim == 0:
        return float(values)
    return xr.DataArray(values, dims=lead, name="anrmse") if lead else values


def nammae(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Average error of minimum and maximum over the channels (paper, eq. NAMMAE).

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    float, or an array over the leading axes

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants or units of two Datasets differ.
    """
    values, _, lead = _apply(core.nammae, predicted, measured, training_std)
    if values.ndim == 0:
        return float(values)
    return xr.DataArray(values, dims=lead, name="nammae") if lead else values


def error_over_time(
    *,
    predicted: Histories,
    measured: Histories,
    training_std: npt.ArrayLike | None = None,
) -> Any:
    """Error at each instant, averaged over the channels: ε(t) of the paper.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training; by default the ones that a forecast carries.

    Returns
    -------
    ndarray, shape (…, time), or DataArray
        In measured standard deviations.

    Raises
    ------
    RequestError
        If shapes or channels do not fit.
    DataError
        If the instants or units of two Datasets differ.
    """
    values, names, lead = _apply(core.error_over_time, predicted, measured, training_std)
    if not names or not isinstance(predicted, xr.Dataset):
        return values
    return xr.DataArray(
        values,
        dims=(*lead, "time"),
        coords={"time": predicted["time"]},
        name="error_over_time",
        attrs={"units": "1", "long_name": "error in measured standard deviations"},
    )
