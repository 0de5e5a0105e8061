"""All channels of a run on one time axis: resampled, flagged, cut to the part that is used."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.channels import Group
from seakeep.campaign.derivation import derive
from seakeep.campaign.settings import CampaignSettings, PreparationSettings
from seakeep.errors import DataError, RequestError
from seakeep.signals import low_pass, resample, uniform_step
from seakeep.signals.quality import MISSING
from seakeep.signals.time_axis import instant_text

__all__ = ["common_axis", "inside", "on_one_axis", "strays"]

FloatArray = npt.NDArray[np.float64]


def overlap(groups: Mapping[str, xr.Dataset], run: str) -> tuple[float, float]:
    """First and last instant at which every logger of a run was recording, s."""
    begin = max(float(each["time"][0]) for each in groups.values())
    end = min(float(each["time"][-1]) for each in groups.values())
    if end <= begin:
        spans = ", ".join(
            f"{name} {_instant(each, 0)} to {_instant(each, -1)} s" for name, each in groups.items()
        )
        raise DataError(
            f"run '{run}': its instruments never recorded together ({spans}, on the reference's "
            "clock). Check the files of the run and the clocks."
        )
    return begin, end


def _instant(group: xr.Dataset, at: int) -> str:
    time = group["time"].to_numpy()
    return instant_text(float(time[at]), float(np.median(np.diff(time))))


def common_axis(groups: Mapping[str, xr.Dataset], dt: float, run: str) -> FloatArray:
    """Multiples of a step from the first group's first instant, where every logger recorded.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Channels by logger, the reference first.
    dt : float
        Time step, s.
    run : str
        Name of the run, for messages.

    Returns
    -------
    ndarray
        Instants, s.

    Raises
    ------
    DataError
        If the loggers never recorded together.
    """
    begin, end = overlap(groups, run)
    origin = float(next(iter(groups.values()))["time"][0])
    first = int(np.ceil((begin - origin) / dt - 1e-6))
    last = int(np.floor((end - origin) / dt * (1 + 1e-9) + 1e-6))
    instants: FloatArray = origin + dt * np.arange(first, last + 1, dtype=float)
    return instants


def on_one_axis(groups: Group, dt: float, settings: CampaignSettings, run: str) -> xr.Dataset:
    """Resample the channels of all loggers to a common step, and derive what needs several.

    Parameters
    ----------
    groups : Group
        Channels by logger.
    dt : float
        Time step, s.
    settings : CampaignSettings
        The campaign.
    run : str
        Name of the run.

    Returns
    -------
    Dataset
        All channels in the campaign's order, with their flags; NaN where samples are missing.

    Raises
    ------
    RequestError
        If the record is shorter than two steps, or a late derivation does not fit.
    DataError
        If the loggers never recorded together.
    """
    time = common_axis(groups, dt, run)
    if time.size < 2:
        length = float(np.diff(overlap(groups, run))[0])
        raise RequestError(
            f"run '{run}' of {length:g} s is shorter than two steps of {dt:g} s. Correct "
            "[preparation]."
        )
    out = xr.Dataset(coords={"time": ("time", time, next(iter(groups.values()))["time"].attrs)})
    for group in groups.values():
        out = out.assign(_resampled(group, time, dt, settings.preparation, run))
        for name in group.coords:
            if str(name).endswith("_flags"):
                flags = _flags(group[name].to_numpy(), group["time"].to_numpy(), time, dt)
                out.coords[str(name)] = ("time", flags, group[name].attrs)
    for name in groups.late:
        out = derive(out, name, settings, dt, run)
    for name in list(out.data_vars):
        if f"{name}_flags" in out.coords:
            lost = (out[f"{name}_flags"].to_numpy() & MISSING) > 0
            out[name] = out[name].copy(data=np.where(lost, np.nan, out[name].to_numpy()))
    return out[[name for name in settings.channel_names if name in out]]


def _resampled(
    group: xr.Dataset, wanted: FloatArray, dt: float, settings: PreparationSettings, run: str
) -> dict[str, tuple[str, FloatArray, dict[str, object]]]:
    time = group["time"].to_numpy()
    own = uniform_step(time, f"run '{run}'")
    names = list(group.data_vars)
    series = np.column_stack([group[name].to_numpy() for name in names])
    filtered = settings.low_pass is not None and settings.low_pass[1] < 0.5 / own
    if filtered and settings.low_pass is not None:
        series = low_pass(series, own, *settings.low_pass)
    if strays(own, time.size, dt) or abs(wanted[0] - time[0]) > 0.05 * own:
        # The last instant may lie a rounding beyond the record.
        clipped = np.clip(wanted, time[0], time[-1])
        fine = not settings.anti_alias and dt > own
        series = resample(series, time, clipped, settings.attenuation, anti_alias=not fine)
    else:
        series = series[: wanted.size]
    out = {}
    for i, name in enumerate(names):
        attributes = dict(group[name].attrs)
        if filtered and settings.low_pass is not None:
            attributes["low_pass"] = tuple(settings.low_pass)
        out[str(name)] = ("time", series[:, i].copy(), attributes)
    return out


def _flags(
    flags: npt.NDArray[np.int16], time: FloatArray, wanted: FloatArray, dt: float
) -> npt.NDArray[np.int16]:
    """Flags at new instants: what any sample within half a new step of them carries."""
    half = 0.5 * max(dt, float(time[1] - time[0])) * (1 + 1e-9)
    begin = np.searchsorted(time, wanted - half)
    end = np.searchsorted(time, wanted + half, side="right")
    out = np.zeros(wanted.size, dtype=np.int16)
    for bit in range(8):
        seen = np.concatenate([[0], np.cumsum((flags >> bit) & 1)])
        out |= ((seen[end] > seen[begin]).astype(np.int16) << bit).astype(np.int16)
    return out


def strays(own: float, samples: int, dt: float) -> bool:
    """Whether a record's own step leads it away from a grid of `dt` by more than rounding.

    Times written with few decimals give a step that is off by a part of a sample over the record.
    """
    return bool(abs(own - dt) * samples > 0.05 * dt)


def inside(time: FloatArray, span: tuple[float, float], dt: float) -> npt.NDArray[np.bool_]:
    """Instants in a span, both ends included."""
    slack = 1e-6 * dt
    return (time >= span[0] - slack) & (time <= span[1] + slack)
