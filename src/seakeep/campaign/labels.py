"""What a prepared run is cut to, and what its attributes say."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.resampling import inside
from seakeep.campaign.settings import CampaignSettings, RunSettings
from seakeep.errors import DataError, RequestError
from seakeep.signals import Clock
from seakeep.signals.time_axis import instant_text
from seakeep.toml import number

__all__ = ["attributes_of", "cropped", "role_of", "version"]


def attributes_of(
    name: str,
    run: xr.Dataset,
    dt: float,
    clocks: Mapping[str, Clock],
    campaign: CampaignSettings,
) -> dict[str, Any]:
    """Attributes of a prepared run that its settings and clocks give.

    Parameters
    ----------
    name : str
        Name of the run.
    run : Dataset
        The run, cut.
    dt : float
        Time step, s.
    clocks : mapping of str to Clock
        Clocks by logger, the reference first.
    campaign : CampaignSettings
        The campaign, nothing in it in encounter periods.

    Returns
    -------
    dict
        Attributes that have a value.
    """
    settings, rig, general = campaign.runs[name], campaign.rig, campaign.campaign
    time = run["time"].to_numpy()
    attributes: dict[str, Any] = {
        "run": name,
        "seakeep_version": version(),
        "file": settings.file or ", ".join(settings.files.values()),
        "preparation_preset": campaign.preparation.preset,
        "dt": float(dt),
        "scale_factor": general.scale_factor,
        "sea_state": settings.sea_state,
        "role": role_of(settings),
        "waves": settings.waves,
        "water_depth": rig.water_depth,
        "wave_direction": rig.wave_direction,
        "frame": rig.frame,
        "encounter_period": general.encounter_period,
        "probe_offset": settings.probe_offset,
        "probe_offset_span": settings.probe_offset_span,
    }
    whole = (float(time[0]), float(time[-1]))
    for use in ("train", "test"):
        span = getattr(settings, use)
        if span is None and role_of(settings) == use:
            span = whole
        if span is not None:
            kept = time[inside(time, span, dt)]
            if kept.size:
                attributes[f"{use}_span"] = (float(kept[0]), float(kept[-1]))
    for logger, clock in list(clocks.items())[1:]:
        attributes |= {
            f"clock_{logger}": clock.describe(),
            f"clock_{logger}_offset": clock.offset,
            f"clock_{logger}_offset_error": clock.offset_error,
            f"clock_{logger}_drift_ppm": 1e6 * clock.drift,
            f"clock_{logger}_drift_error_ppm": 1e6 * clock.drift_error,
        }
    return {key: value for key, value in attributes.items() if value is not None}


def cropped(
    run: xr.Dataset, name: str, settings: RunSettings, record: tuple[float, float]
) -> xr.Dataset:
    """Cut a run to the part that is used.

    Parameters
    ----------
    run : Dataset
        The whole run.
    name : str
        Its name, for messages.
    settings : RunSettings
        Its settings, spans in seconds.
    record : (float, float)
        First and last instant of the reference, s.

    Returns
    -------
    Dataset
        The run inside its span.

    Raises
    ------
    RequestError
        If a span lies outside the record, or holds fewer than two samples.
    DataError
        If fewer than two samples are left of a span because a logger does not reach into it.
    """
    time, dt = run["time"].to_numpy(), float(np.median(np.diff(run["time"].to_numpy())))
    for key in ("span", "train", "test"):
        span = getattr(settings, key)
        if span is None:
            continue
        finite = [edge for edge in span if np.isfinite(edge)]
        if any(not record[0] - dt < edge < record[1] + dt for edge in finite):
            begin, end = _texts(record, dt)
            raise RequestError(
                f"runs.{name}.{key}: received [{', '.join(_texts(span, dt))}] s, and the record "
                f"runs from {begin} to {end} s. Correct the span; 'inf' stands for the end."
            )
        _refuse_empty(f"runs.{name}.{key}", span, time, dt, record)
    if settings.span is None:
        return run
    whole = number(settings.span[0]), number(settings.span[1])
    kept = run.isel(time=inside(time, whole, dt))
    for key in ("train", "test"):
        if (span := getattr(settings, key)) is not None:
            time = kept["time"].to_numpy()
            own = (float(time[0]), float(time[-1]))
            _refuse_empty(f"runs.{name}.{key}", span, time, dt, own)
    return kept


def _refuse_empty(
    key: str,
    span: tuple[float, float],
    time: npt.NDArray[np.float64],
    dt: float,
    record: tuple[float, float],
) -> None:
    """Refuse a span that holds too few of a run's instants, whose record is the reference's."""
    if (count := int(inside(time, span, dt).sum())) > 1:
        return
    stretch = ", ".join(_texts(span, dt))
    stated = f"{key}: [{stretch}] s holds {count} sample(s) at a step of {dt:.4g} s"
    begin, end = _texts((float(time[0]), float(time[-1])), dt)
    if time[0] > record[0] + 2 * dt or time[-1] < record[1] - 2 * dt:
        first, last = _texts(record, dt)
        raise DataError(
            f"{stated}, since all loggers recorded together only from {begin} to {end} s; the "
            f"reference runs from {first} to {last} s. Check whether the files of the other "
            "loggers are whole, or correct the span."
        )
    raise RequestError(
        f"{stated}. Lengthen the span, or move it into the run's {begin} to {end} s."
    )


def _texts(span: tuple[float, float], dt: float) -> tuple[str, str]:
    return instant_text(span[0], dt), instant_text(span[1], dt)


def role_of(settings: RunSettings) -> str:
    """What a run serves for: "train", "test", "train and test" or "unused"."""
    if settings.train and settings.test:
        return "train and test"
    if settings.train or settings.test:
        return "train" if settings.train else "test"
    return settings.role or "train"


def version() -> str:
    """Version of seakeep, "unknown" where it is not installed."""
    try:
        return metadata.version("seakeep")
    except metadata.PackageNotFoundError:
        return "unknown"
