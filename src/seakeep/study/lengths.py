"""Instants and numbers of samples that may be stated in encounter periods."""

from __future__ import annotations

from collections.abc import Iterable

import xarray as xr

from seakeep.campaign import Campaign
from seakeep.errors import RequestError
from seakeep.toml import parse_length

__all__ = ["instant_of", "samples_of"]


def instant_of(
    stated: float | str, campaign: Campaign, runs: Iterable[xr.Dataset], name: str
) -> float:
    """Instant in seconds.

    Parameters
    ----------
    stated : float or str
        Seconds, or a text such as ``"20 T"``: encounter periods of the campaign.
    campaign : Campaign
        The campaign.
    runs : iterable of Dataset
        Prepared runs; where they know the encounter period, no file is read for it.
    name : str
        What is stated, for messages.

    Returns
    -------
    float
        Seconds.

    Raises
    ------
    RequestError
        If the text says something else, or the campaign has no encounter period.
    """
    if not isinstance(stated, str):
        return float(stated)
    try:
        return float(stated)
    except ValueError:
        return _count(stated, name, "seconds such as 20") * _period(campaign, runs)


def samples_of(
    stated: float | str, campaign: Campaign, runs: Iterable[xr.Dataset], dt: float, name: str
) -> int:
    """Number of samples; a length in encounter periods is rounded to the nearest one.

    Parameters
    ----------
    stated : int or str
        A number of samples, or a text such as ``"15 T"``: encounter periods of the campaign.
    campaign, runs, name
        As in :func:`instant_of`.
    dt : float
        Time step, s.

    Returns
    -------
    int
        Samples.

    Raises
    ------
    RequestError
        As :func:`instant_of`.
    """
    if not isinstance(stated, str):
        return int(stated)
    try:
        return int(stated)
    except ValueError:
        count = _count(stated, name, "a whole number such as 400")
        return round(count * _period(campaign, runs) / dt)


def _count(stated: str, name: str, otherwise: str) -> float:
    try:
        length = parse_length(stated)
    except RequestError:
        length = None
    if length is None or length.unit != "T":
        comma = " Write a decimal point, no comma." if "," in stated else ""
        raise RequestError(
            f"{name}: received '{stated}'. Give {otherwise}, or encounter periods such as "
            f"'15 T'.{comma}"
        )
    return length.value


def _period(campaign: Campaign, runs: Iterable[xr.Dataset]) -> float:
    known = [float(r.attrs["encounter_period"]) for r in runs if "encounter_period" in r.attrs]
    return known[0] if known else campaign.encounter_period()
