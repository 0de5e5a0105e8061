"""Regular waves: what of the error is offset, what amplitude and phase, and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.report.figures.common import model_words
from seakeep.report.section import Section
from seakeep.report.sections.summary import conditional
from seakeep.report.tables import Table, number, signed
from seakeep.study import StudyResult

__all__ = ["regular", "response_words"]

LARGE = 0.5
"""NRMSE from which on the words look for a cause."""
PHASE = 15.0
"""Degrees by which a forecast is out of step; 15° make an NRMSE of 0.26."""
FITS = 1.5
"""Factor within which an offset counts as what falling back to the training mean makes."""
SELDOM = 0.01
"""Part of a run's samples below which a slack line is not worth a word."""


def regular(result: StudyResult) -> Section | None:
    """Return the errors in regular waves, taken apart."""
    tests = [test for test in result.tests if f"statistics/response/{test}" in result.groups]
    if not tests:
        return None
    return Section(
        "regular",
        "Regular waves: where the error comes from",
        words=tuple(response_words(result, test) for test in tests),
        tables=tuple(_table(result, test) for test in tests),
    )


def _table(result: StudyResult, test: str) -> Table:
    data = result.groups[f"statistics/response/{test}"]
    rows = []
    for name in result.channels:
        for model in result.models:
            at = data.sel(channel=name, model=model)
            rows.append(
                (
                    result.words_of(name),
                    model_words(model),
                    number(float(at["sd_ratio"]), 2),
                    signed(float(at["mean_shift"]), 2),
                    *(number(float(at[f"error_{key}"]), 2) for key in ("offset", "wave", "rest")),
                    number(float(at["amplitude_ratio"]), 2),
                    signed(float(at["phase_lead"]), 0),
                )
            )
    return Table(
        f"response_{test}",
        f"Error taken apart, {result.label_of(test)} ({data.attrs['frequency']:.3f} Hz)",
        (
            "channel", "model", "measured SD [training SD]", "mean off training [training SD]",
            "offset", "at the wave's frequency", "rest", "amplitude ratio", "phase lead [°]",
        ),
        tuple(rows),
        "Offset, response at the wave's frequency and rest are root mean squares over all cells in "
        "measured SDs; their squares add up to that of the NRMSE. Amplitude ratio and phase lead: "
        "forecast against measurement at that frequency; a lead says that the forecast is early."
        + conditional(result),
        tuple(range(2, 9)),
    )  # fmt: skip


def response_words(result: StudyResult, test: str) -> str:
    """Why the error in regular waves is what it is, as far as the numbers tell."""
    data = result.groups[f"statistics/response/{test}"]
    label, model = result.label_of(test), result.models[0]
    at, facts = data.sel(model=model), data.attrs
    words = [f"{label[:1].upper() + label[1:]}, {facts['frequency']:.3f} Hz:"]
    if np.isfinite(facts["energy_share"]):
        words.append(
            f"{100 * facts['energy_share']:.0f} % of the training sea's energy lies within a tenth "
            f"of this frequency, and the waves are {facts['height_ratio']:.2f} times as high "
            "(heights counted as 4 standard deviations of the elevation)."
        )
    drifting = (at["error_offset"] > at["error_wave"]) & (at["error_offset"] > LARGE)
    waves = at["error_wave"].where(~drifting)
    moving = data["channel"].values[np.isfinite(waves.values)]
    if len(moving):
        words.append(_wave_words(at, moving, model_words(model)))
    words += _celerity_words(at, facts)
    if bool(drifting.any()):
        names = [str(n) for n in data["channel"].values[drifting.values]]
        words.append(_drift_words(result, at, names))
    return " ".join(words + _slack_words(result, test))


def _slack_words(result: StudyResult, test: str) -> list[str]:
    """Name the lines that lose their load in the runs of a test set."""
    tested = sorted({str(run) for run in result.tests[test]["run"].values})
    slack = result.groups["runs"]["slack"].sel(run=tested, name=result.channels).max("run")
    listed = [
        f"{result.words_of(str(name))} in {100 * float(part):.0f} %"
        for name, part in zip(slack["name"].values, slack.values, strict=True)
        if part >= SELDOM
    ]
    if not listed:
        return []
    return [
        f"Slack line: {', '.join(listed)} of a run's samples (a load below 0.1 % of the largest). "
        "A slack line does not respond linearly. Where it is slack throughout, only noise is left: "
        "offset, amplitude ratio and phase lead say little of such a load."
    ]


def _wave_words(at: xr.Dataset, moving: npt.NDArray[Any], who: str) -> str:
    part = at.sel(channel=moving)
    ratio, lead = float(part["amplitude_ratio"].median()), float(part["phase_lead"].median())
    error = float(part["error_wave"].median())
    size = f"{100 * abs(ratio - 1):.0f} % too {'large' if ratio > 1 else 'small'}"
    sense = "early" if lead > 0 else "late"
    return (
        f"In the {len(moving)} channels where no offset leads, the {who} forecast is in the median "
        f"{size} at the wave's frequency and {abs(lead):.0f}° {sense}; that is an NRMSE of "
        f"{error:.2f} there."
    )


def _celerity_words(at: xr.Dataset, facts: dict[str, float]) -> list[str]:
    lead, shift = float(at["celerity_phase"]), float(facts["surge_shift"])
    if not np.isfinite(lead):
        return []
    out = f"{abs(lead):.0f}° {'early' if lead > 0 else 'late'}"
    if abs(lead) < 0.5:
        out = "less than 1° early or late"
    said = (
        f"The alignment carries all waves at {float(at['celerity']):.2f} m/s; these run at "
        f"{facts['phase_speed']:.2f} m/s, and the vessel lies {abs(shift):.2f} m "
        f"{'down' if shift > 0 else 'up'}stream of its training mean: that alone makes the "
        f"forecast {out}."
    )
    if abs(lead) > PHASE:
        said += (
            " Alignment by linear dispersion (mode = 'dispersion') has none of this error of one "
            "celerity; the other causes of error remain."
        )
    return [said]


def _drift_words(result: StudyResult, at: xr.Dataset, names: list[str]) -> str:
    part = at.sel(channel=names)
    listed = ", ".join(
        f"{result.words_of(name)} ({float(each['error_offset']):.1f} measured SDs; mean "
        f"{signed(float(each['mean_shift']), 1)} training SDs off, measured SD "
        f"{float(each['sd_ratio']):.2f} of the training SD)"
        for name in names
        for each in [part.sel(channel=name)]
    )
    said = [f"An offset leads in {listed}."]
    expected = abs(part["mean_shift"]) / part["sd_ratio"]
    off = abs(np.log(expected / part["error_offset"])) > np.log(FITS)
    away = [str(name) for name in part["channel"].values[off.values]]
    if len(away) < len(names):
        near = ", ".join(result.words_of(name) for name in names if name not in away)
        said.append(
            "A linear model falls back to its training mean, and steady drift grows with the "
            f"square of the waves: that accounts for the offset{f' in {near}' if away else ''} "
            f"within a factor of {FITS:g}."
        )
    if away:
        numbers = ", ".join(
            f"{float(expected.sel(channel=name)):.1f} in {result.words_of(name)}" for name in away
        )
        said.append(
            "Falling back to the training mean would make an offset, in measured SDs, of "
            f"{numbers}: that does not account for what was found."
        )
    return " ".join(said)
