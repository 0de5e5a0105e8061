"""A run that was read becomes one that a model takes: one axis, checked, told of, and cut."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.channels import Group
from seakeep.campaign.checks import as_attribute, checked, warn_of_positions
from seakeep.campaign.labels import cropped
from seakeep.campaign.plausibility import implausible, warn_of
from seakeep.campaign.resampling import on_one_axis
from seakeep.campaign.settings import CampaignSettings
from seakeep.campaign.survey import Survey

__all__ = ["Told", "finished", "reference_time"]


@dataclass
class Told:
    """What was warned of already, so that each run does not warn again.

    Parameters
    ----------
    misplaced : set of str
        Probes.
    doubted : set of (str, str)
        Channels, and what of them.
    """

    misplaced: set[str] = field(default_factory=set)
    doubted: set[tuple[str, str]] = field(default_factory=set)


def reference_time(groups: Group) -> npt.NDArray[np.float64]:
    """Instants of the reference logger, s."""
    time: npt.NDArray[np.float64] = next(iter(groups.values()))["time"].to_numpy()
    return time


def finished(
    name: str,
    groups: Group,
    dt: float,
    found: Survey,
    settings: CampaignSettings,
    told: Told,
) -> xr.Dataset:
    """Put a run on one axis, check it, and cut it to its span.

    Parameters
    ----------
    name : str
        The run.
    groups : dict of str to Dataset
        What its loggers recorded, the reference first.
    dt : float
        Step, s.
    found : Survey
        What the survey of all runs found.
    settings : CampaignSettings
        The campaign, lengths in seconds.
    told : Told
        Taken note of in warnings.

    Returns
    -------
    Dataset
        The run, with its findings in ``attrs["quality"]``.

    Warns
    -----
    SeakeepWarning
        Of probes that seem misplaced and of values that cannot be, once a campaign.
    """
    whole = on_one_axis(groups, dt, settings, name)
    findings = checked(name, groups, whole, found.clocks[name], settings, found.left_out)
    findings += implausible(name, groups, whole, settings, found.doubts)
    warn_of_positions(findings, name, told.misplaced)
    warn_of(findings, name, told.doubted)
    reference = reference_time(groups)
    run = cropped(whole, name, settings.runs[name], (float(reference[0]), float(reference[-1])))
    run.attrs["quality"] = as_attribute(findings)
    return run
