"""Whether a run can be what it claims: whole records, and values that a vessel can reach."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from statistics import median_high, median_low

import xarray as xr

from seakeep.campaign.checks import Finding
from seakeep.campaign.settings import RunSettings
from seakeep.campaign.survey import used_span
from seakeep.errors import SeakeepWarning

__all__ = ["check_records", "warn_of"]

LOST = 0.05
"""Part of a run's used span that a logger may miss: they are started and stopped by hand, seconds
apart, and runs last minutes."""


def check_records(groups: Mapping[str, xr.Dataset], settings: RunSettings) -> list[Finding]:
    """Loggers that begin well after the others of their run, or end well before them.

    The others are judged by their median, so that one that was left running speaks against none.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Channels by logger, on the reference's time.
    settings : RunSettings
        The run; what lies outside its span does no harm.

    Returns
    -------
    list of Finding
        Of kind ``record``, one a logger and end: the run is cut to what all recorded.
    """
    if len(groups) < 2:
        return []
    spans = {n: (float(g["time"][0]), float(g["time"][-1])) for n, g in groups.items()}
    used = used_span(settings)
    first = max(median_low(begin for begin, _ in spans.values()), used[0])
    last = min(median_high(end for _, end in spans.values()), used[1])
    limit = LOST * (last - first)
    out = []
    for name, (begin, end) in spans.items():
        if begin - first > limit:
            text = f"begins at {begin:.4g} s, the other loggers at {first:.4g} s"
            out.append(Finding(name, "record", f"{text}: the run is cut to what all recorded"))
        if last - end > limit:
            text = f"ends at {end:.4g} s, the other loggers at {last:.4g} s"
            out.append(Finding(name, "record", f"{text}: the run is cut to what all recorded"))
    return out


_MENDS = {
    "record": "Check whether its file is whole; if it is, state span = [begin, end] in [runs.{run}]"
    " to say which part is meant.",
}
"""What to do about each kind of finding of which a warning is given."""


def warn_of(findings: Iterable[Finding], run: str) -> None:
    """Warn of findings that make a run another one than the campaign says.

    Parameters
    ----------
    findings : iterable of Finding
        Of the run.
    run : str
        Its name.

    Warns
    -----
    SeakeepWarning
        One a finding of these kinds.
    """
    for each in findings:
        if each.kind in _MENDS:
            mend = _MENDS[each.kind].format(run=run)
            warnings.warn(f"{run}: {each.channel} {each.text}. {mend}", SeakeepWarning, 3)
