"""Error measures of a forecast, for arrays and for Datasets.

All take ``predicted=`` and ``measured=`` by keyword, in the same units. Arrays are
``(…, time, channel)``. With Datasets the channels of `predicted` are judged at its instants, each
against the variable of the same name in `measured`; per-channel measures come back as a Dataset
of numbers. A channel whose measured standard deviation in the window is below 1 % of its training
standard deviation (a slack line) is NaN and left out of averages; forecasts carry the training
standard deviation in the attribute ``training_std`` of each channel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core import metrics as core
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.signals.clocks import check_order

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


def _pair(
    predicted: xr.Dataset, measured: xr.Dataset
) -> tuple[list[str], dict[str, npt.NDArray[np.float64]], tuple[str, ...]]:
    names = [str(name) for name in predicted.data_vars]
    known = [str(name) for name in measured.data_vars]
    missing = [name for name in names if name not in known]
    if missing:
        raise RequestError(
            f"measured has no channel '{missing[0]}'.{did_you_mean(missing[0], known)} "
            f"It has: {', '.join(known)}. Select the channels to judge: predicted[['heave']]."
        )
    for name in names:
        units = [side[name].attrs.get("units") for side in (predicted, measured)]
        if all(units) and units[0] != units[1]:
            raise DataError(
                f"channel '{name}' is in '{units[0]}' in predicted and in '{units[1]}' in "
                "measured. Convert one of them and its units attribute."
            )
    for side, data in (("predicted", predicted), ("measured", measured)):
        if "time" not in data.coords:
            raise DataError(
                f"{side} has no coordinate 'time' (dimensions: {', '.join(map(str, data.dims))}). "
                "Give every channel the dimension 'time' and the instants in seconds."
            )
        check_order(data["time"].values, side)
    time = predicted["time"].values
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    try:
        at = measured[names].sel(time=time, method="nearest", tolerance=0.01 * step)
    except KeyError as error:
        raise DataError(
            f"predicted runs from {time[0]:g} to {time[-1]:g} s and measured from "
            f"{float(measured.time[0]):g} to {float(measured.time[-1]):g} s, and not every instant "
            "of the first is one of the second. Judge where both exist, on one time axis."
        ) from error
    lead = tuple(str(dim) for dim in predicted.dims if dim != "time")
    p = np.stack([predicted[name].transpose(*lead, "time").values for name in names], axis=-1)
    m = np.stack([at[name].values for name in names], axis=-1)
    spread = np.array([float(predicted[name].attrs.get("training_std", 0.0)) for name in names])
    return names, {"predicted": p, "measured": m, "training_std": spread}, lead


def _apply(
    measure: Measure, predicted: Histories, measured: Histories, training_std: npt.ArrayLike | None
) -> tuple[Any, list[str], tuple[str, ...]]:
    if isinstance(predicted, xr.Dataset) != isinstance(measured, xr.Dataset):
        raise RequestError(
            "predicted and measured must both be Datasets or both be arrays; received "
            f"{type(predicted).__name__} and {type(measured).__name__}."
        )
    if isinstance(predicted, xr.Dataset) and isinstance(measured, xr.Dataset):
        names, arrays, lead = _pair(predicted, measured)
        if training_std is not None:
            arrays["training_std"] = np.asarray(training_std, dtype=float)
        return measure(**arrays), names, lead
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
    values, names, _ = _apply(core.is_slack, predicted, measured, training_std)
    if not names:
        return values
    return xr.Dataset({name: ((), values[column]) for column, name in enumerate(names)})


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
