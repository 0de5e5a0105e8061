"""Bands of ensembles in parts: waves, horizon, channels, with scores beside their width."""

from __future__ import annotations

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.report.figures.common import model_words
from seakeep.report.section import Section
from seakeep.report.sections.summary import conditional
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult

__all__ = ["bands"]


def bands(result: StudyResult) -> Section | None:
    """Return coverage and scores of bands by wave height, horizon and channel."""
    if "statistics/bands" not in result.groups:
        return None
    found = result.groups["statistics/bands"]
    groups = {
        str(test): found.sel(test=test).dropna("part", how="all") for test in found["test"].values
    }
    tables = [
        make(result, groups, model, band)
        for model in (m for m in result.models if result.is_ensemble(m))
        for band in ("members", "calibrated")
        for make in (_by_part, _by_channel)
        if any(_known(data, model, band) for data in groups.values())
    ]
    if not tables:
        return None
    words = (
        "Thirds of the instants by the height of the waves around them, and by the age of the "
        "forecast. The Winkler score is the width of the band and 2/(1 − level) times what "
        "lies outside of it; the CRPS is that of the normal distribution that the band stands "
        "for. Less is better in both: a band that is wide without need scores badly, and so does "
        "a narrow one that misses."
    )
    return Section(
        "bands", "Bands by waves, horizon and channel", words=(words,), tables=(*tables,)
    )


def _known(data: xr.Dataset, model: str, band: str) -> bool:
    """Whether a test set has that band."""
    here = band in data["band"].values and model in data["model"].values
    return here and bool(data["inside"].sel(model=model, band=band).notnull().any())


def _by_part(result: StudyResult, groups: dict[str, xr.Dataset], model: str, band: str) -> Table:
    """Averages over the channels, a row per test set and part."""
    rows = []
    for test, data in groups.items():
        if not _known(data, model, band):
            continue
        at = data.sel(model=model, band=band)
        for part in data["part"].values:
            one = at.sel(part=part)
            scale = one["relative_width"] / one["width"]  # one over the measured SD
            least = one["channel"].values[int(np.nanargmin(one["inside"].values))]
            rows.append(
                (
                    result.label_of(test),
                    str(part),
                    number(one["inside"].mean(), 2),
                    f"{number(one['inside'].min(), 2)} ({result.words_of(str(least))})",
                    number(_mean(one["relative_width"].values), 2),
                    *(number(_mean((one[key] * scale).values), 2) for key in ("winkler", "crps")),
                )
            )
    return Table(
        f"bands_{band}_{model}",
        f"{_title(result, model, band)}, in parts",
        ("test set", "instants", "inside", "least covered", "width", "Winkler", "CRPS"),
        rows,
        "Averages over the channels; width and scores in measured SD of the test set."
        + conditional(result),
        (2, 4, 5, 6),
    )


def _by_channel(result: StudyResult, groups: dict[str, xr.Dataset], model: str, band: str) -> Table:
    """All instants, a row per test set and channel."""
    units = result.groups["channels"]
    rows = []
    for test, data in groups.items():
        if not _known(data, model, band):
            continue
        at = data.sel(model=model, band=band, part="all")
        for name in result.channels:
            one = at.sel(channel=name)
            rows.append(
                (
                    result.label_of(test),
                    f"{result.words_of(name)} [{units['units'].sel(name=name).item()}]",
                    number(one["inside"], 2),
                    number(one["relative_width"], 2),
                    *(f"{float(one[key]):.3g}" for key in ("winkler", "crps")),
                )
            )
    return Table(
        f"bands_{band}_{model}_channels",
        f"{_title(result, model, band)}, by channel",
        ("test set", "channel", "inside", "width [SD]", "Winkler", "CRPS"),
        rows,
        "Scores in the unit of the channel (SI)." + conditional(result),
        (2, 3, 4, 5),
        folded=True,
    )


def _title(result: StudyResult, model: str, band: str) -> str:
    level = 100 * float(result.settings["statistics"]["level"])
    kind = "calibrated " if band == "calibrated" else ""
    return f"{kind}{level:g} % band of the {model_words(model)} model".capitalize()


def _mean(values: FloatArray) -> float:
    """Mean over the channels that move; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan
