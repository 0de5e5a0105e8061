"""Parts of runs on which the band of an ensemble is calibrated."""

from __future__ import annotations

import math
from collections.abc import Mapping

import xarray as xr

from seakeep.campaign import Campaign
from seakeep.errors import RequestError
from seakeep.signals.time_axis import instant_text, span_text
from seakeep.study.comparison import instant_of
from seakeep.study.plan import between


def calibration_parts(
    campaign: Campaign,
    runs: Mapping[str, xr.Dataset],
    dt: float,
    start: str | None = None,
    stop: str | None = None,
) -> dict[str, xr.Dataset]:
    """Part of each run between two instants, by default its training span, or the whole run.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    runs : mapping of str to Dataset
        Prepared runs.
    dt : float
        Their time step, s.
    start, stop : str, optional
        Seconds, or encounter periods such as ``"20 T"``; a stop of ``"inf"`` is the end of all.

    Returns
    -------
    dict of str to Dataset
        The parts.

    Raises
    ------
    RequestError
        If an instant lies in none of the runs, or the start at or after the stop.
    """
    spans = {name: (float(each["time"][0]), float(each["time"][-1])) for name, each in runs.items()}
    edges: dict[str, float] = {}
    for option, stated in (("--start", start), ("--stop", stop)):
        if stated is None:
            continue
        instant = edges[option] = instant_of(stated, campaign, runs.values(), option)
        inside = any(begin <= instant <= end for begin, end in spans.values())
        if not (inside or (option == "--stop" and instant == math.inf)):
            known = ", ".join(f"{name}: {span_text(*span, dt)}" for name, span in spans.items())
            raise RequestError(
                f"{option} {stated} ({instant_text(instant, dt)} s) lies in none of the runs "
                f"({known}). Name an instant inside, or leave {option} out."
            )
    if len(edges) == 2 and edges["--start"] >= edges["--stop"]:
        begin, end = (instant_text(edge, dt) for edge in edges.values())
        raise RequestError(f"--start {start} ({begin} s) lies at or after --stop {stop} ({end} s).")
    parts = {}
    for name, run in runs.items():
        first, last = run.attrs.get("train_span", spans[name])
        parts[name] = between(run, (edges.get("--start", first), edges.get("--stop", last)))
    return parts
