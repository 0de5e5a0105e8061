"""What a prepared run is cut to, and what its attributes say."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from typing import Any

import xarray as xr

from seakeep.campaign.pipeline import inside
from seakeep.campaign.settings import CampaignSettings, RunSettings
from seakeep.signals import Clock

__all__ = ["attributes_of", "role_of", "version"]


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
            f"clock_{logger}_method": clock.method,
            f"clock_{logger}_count": clock.count,
            f"clock_{logger}_offset": clock.offset,
            f"clock_{logger}_offset_error": clock.offset_error,
            f"clock_{logger}_drift_ppm": 1e6 * clock.drift,
            f"clock_{logger}_drift_error_ppm": 1e6 * clock.drift_error,
        }
    return {key: value for key, value in attributes.items() if value is not None}


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
