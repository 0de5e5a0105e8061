"""Error measures of a forecast, for arrays and for Datasets.

All take ``predicted=`` and ``measured=`` by keyword, in the same units. Arrays are
``(…, time, channel)``. With Datasets the channels of `predicted` are judged at its instants, each
against the variable of the same name in `measured`; words, such as the status of an ensemble's
members, are no channels. Per-channel measures come back as a Dataset of numbers. A channel whose
measured standard deviation in the window is below 1 % of its training standard deviation (a slack
line) is NaN and left out of averages; forecasts carry the training standard deviation in the
attribute ``training_std`` of each channel.

A measure is one function of arrays in :mod:`seakeep.core.metrics`, and one line here.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeVar, overload

import numpy.typing as npt
import xarray as xr

from seakeep.arrays import BoolArray, FloatArray
from seakeep.core import metrics as core
from seakeep.errors import RequestError
from seakeep.pairing import Paired, pair

__all__ = [
    "Measure",
    "anrmse",
    "error_over_time",
    "fit_percent",
    "is_slack",
    "labelled",
    "nammae",
    "normalised_extremes_error",
    "nrmse",
]

Labels = TypeVar("Labels", covariant=True)
Numbers = TypeVar("Numbers", covariant=True)


class Measure(Protocol[Labels, Numbers]):
    """A measure of arrays and of Datasets; made by :func:`labelled`."""

    @overload
    def __call__(
        self,
        *,
        predicted: xr.Dataset,
        measured: xr.Dataset,
        training_std: npt.ArrayLike | None = None,
    ) -> Labels: ...
    @overload
    def __call__(
        self,
        *,
        predicted: npt.ArrayLike,
        measured: npt.ArrayLike,
        training_std: npt.ArrayLike | None = None,
    ) -> Numbers: ...


def labelled(
    measure: Callable[..., Any],
    keeps: Literal["channel", "time", "neither"],
    units: str = "1",
    label: str | None = None,
) -> Measure[Any, Any]:
    """Let a measure of arrays take Datasets too.

    Parameters
    ----------
    measure : callable
        Of arrays ``predicted=``, ``measured=`` (…, time, channel) and ``training_std=``;
        :func:`seakeep.core.metrics.paired` checks them.
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
    def judged(*, predicted: Any, measured: Any, training_std: Any = None) -> Any:
        if isinstance(predicted, xr.Dataset) != isinstance(measured, xr.Dataset):
            raise RequestError(
                "predicted and measured must both be Datasets or both be arrays; received "
                f"{type(predicted).__name__} and {type(measured).__name__}."
            )
        if not isinstance(predicted, xr.Dataset):
            values = measure(predicted=predicted, measured=measured, training_std=training_std)
            return values if values.ndim else values.item()
        pairs = pair(predicted=predicted, measured=measured)
        if training_std is None:
            training_std = [predicted[each].attrs.get("training_std", 0.0) for each in pairs.names]
        values = measure(**pairs.arrays, training_std=training_std)
        if keeps == "channel":
            return _per_channel(values, pairs, {"units": units}, name)
        if values.ndim == 0:
            return values.item()
        dims = (*pairs.lead, "time") if keeps == "time" else pairs.lead
        coords = {dim: predicted[dim] for dim in dims if dim in predicted.coords}
        attrs = {"units": units, "long_name": name}
        return xr.DataArray(values, coords, dims, name=measure.__name__, attrs=attrs)

    judged.__module__ = __name__
    return judged


def _per_channel(values: Any, pairs: Paired, attrs: dict[str, str], label: str) -> xr.Dataset:
    lead = pairs.lead[: values.ndim - 1]
    return xr.Dataset(
        {
            name: (lead, values[..., column], attrs | {"long_name": f"{label} of {name}"})
            for column, name in enumerate(pairs.names)
        }
    )


is_slack: Measure[xr.Dataset, BoolArray] = labelled(core.is_slack, "channel", label="slackness")
nrmse: Measure[xr.Dataset, FloatArray] = labelled(core.nrmse, "channel", label="NRMSE")
normalised_extremes_error: Measure[xr.Dataset, FloatArray] = labelled(
    core.normalised_extremes_error, "channel", label="NAMMAE"
)
fit_percent: Measure[xr.Dataset, FloatArray] = labelled(core.fit_percent, "channel", "%", "fit")
anrmse: Measure[float | xr.DataArray, float | FloatArray] = labelled(core.anrmse, "neither")
nammae: Measure[float | xr.DataArray, float | FloatArray] = labelled(core.nammae, "neither")
error_over_time: Measure[xr.DataArray, FloatArray] = labelled(
    core.error_over_time, "time", label="error in measured standard deviations"
)
