"""Beyond one number per cell: age of a forecast, band, densities, members, service."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from seakeep.report.figures.common import judged_models, model_words
from seakeep.report.figures.errors import (
    BAND_WORDS,
    LOWEST,
    density_figure,
    eigenvalue_figure,
    error_over_time_figure,
    hyperparameter_figure,
)
from seakeep.report.nowcast import nowcast_blocks, nowcast_figure
from seakeep.report.section import Drawing, Section
from seakeep.report.sections.summary import by_channel, conditional
from seakeep.report.tables import MISSING, Table, number, probability, small_number
from seakeep.study import StudyResult
from seakeep.study.judge import VARIANTS

__all__ = [
    "age",
    "coverage",
    "coverage_table",
    "densities",
    "divergence_table",
    "members",
    "service",
]

PUBLISHED = {
    "surge": ("0.0026", "0.0010", "0.0061", "0.0052"),
    "heave": ("0.0031", "0.0013", "0.0061", "0.0049"),
    "pitch": ("0.0035", "0.0017", "0.0076", "0.0059"),
    "surge_rate": ("0.0021", "0.0007", "0.0063", "0.0057"),
    "heave_rate": ("0.0036", "0.0015", "0.0075", "0.0060"),
    "pitch_rate": ("0.0041", "0.0011", "0.0106", "0.0095"),
    "surge_acceleration": ("0.0045", "0.0028", "0.0073", "0.0045"),
    "heave_acceleration": ("0.0071", "0.0030", "0.0140", "0.0110"),
    "pitch_acceleration": ("0.0086", "0.0028", "0.0181", "0.0153"),
    "mooring_bow": ("0.0186", "0.0099", "0.0302", "0.0203"),
    "mooring_stern": ("0.0274", "0.0185", "0.0387", "0.0202"),
    "average": ("0.0077", "0.0040", "0.0139", "0.0099"),
}
"""Divergence that the paper publishes, BHDMDc of the CK-14e in irregular waves: EV and quantiles
0.025 and 0.975 of the bootstrap, and their difference U.

They come from another vessel in another tank; they are for orientation, and nothing is tuned to
them.
"""


def _ensembles(result: StudyResult) -> list[str]:
    return [model for model in result.models if result.is_ensemble(model)]


def age(result: StudyResult) -> Section:
    """Return the error over the age of a forecast."""
    split = float(result.settings["statistics"]["split_period"])
    figure = Drawing(
        "error_over_time",
        "ε(t): mean over all cells (lines) and quartiles (shaded), with the p-value of its trend "
        f"test; the error as a whole, and parted at a period of {split:g} T̂ into slow drift and "
        "waves. Each row has its own scale.",
        partial(error_over_time_figure, result),
    )
    title = "Error over the age of a forecast"
    return Section("time", title, figures=(figure,), tables=(_trend_table(result),))


def _trend_table(result: StudyResult) -> Table:
    rows = []
    for test in result.tests:
        data: xr.Dataset = result.groups["statistics/trend"].sel(test=test)
        for band, words in BAND_WORDS.items():
            for model in judged_models(result):
                at = data.sel(model=model, band=band)
                interval = ", ".join(small_number(at[key]) for key in ("lower", "upper"))
                rows.append(
                    (
                        result.label_of(test),
                        words,
                        model_words(model),
                        number(at["error_mean"].mean()),
                        number(at["change"]),
                        f"{small_number(at['slope'])} [{interval}]",
                        number(at["kendall_tau"], 2),
                        probability(at["p_value"]),
                    )
                )
    period = float(result.settings["statistics"]["split_period"])
    seconds = period * float(result.attrs["encounter_period"])
    return Table(
        "trend",
        "Trend of ε(t), whole and in bands",
        (
            "test set", "band", "model", "mean ε", "change over the window",
            "slope [1/s] with 95 %", "Kendall's τ", "p",
        ),
        rows,
        "Block-bootstrap Mann–Kendall test of ε(t) averaged over all cells. A p below 0.05 says "
        "that the error changes with the age of the forecast; blocks break some of the "
        "dependence, so slow series are called trends too often (10 to 15 %). The error is parted "
        f"at a period of {period:g} T̂ ({seconds:.2f} s) into slow drift and waves; both are "
        "counted in SDs of the whole measured channel." + conditional(result),
        (3, 4, 5, 6, 7),
    )  # fmt: skip


def coverage(result: StudyResult) -> Section | None:
    """Return coverage and width of the bands of ensembles."""
    tables = tuple(
        coverage_table(result, model, calibrated)
        for model in _ensembles(result)
        for calibrated in (False, True)
        if not calibrated or result.is_calibrated
    )
    return Section("coverage", "Coverage of the band", tables=tables) if tables else None


def coverage_table(result: StudyResult, model: str, calibrated: bool = False) -> Table:
    """Coverage and width of the members' band, or of the calibrated one, per test and channel."""
    prefix, words = ("calibrated_", "calibrated ") if calibrated else ("", "")
    found = result.groups["statistics/coverage"].sel(model=model)
    groups = {test: found.sel(test=test) for test in result.tests}
    true = any("truth" in data["against"].values for data in groups.values())
    heads = [
        f"{result.label_of(test)}: {words}"
        for test in groups
        for words in ("inside" + " [of the truth]" * true, "width [SD]")
    ]

    def cells(name: str) -> Iterator[str]:
        for data in groups.values():
            at = data.sel(channel=name)
            first, *others = (number(v, 2) for v in at[f"{prefix}inside"].values)
            yield first + "".join(f" [{each}]" for each in others)
            yield number(at[f"{prefix}relative_width"].sel(against="measured"), 2)

    level = float(result.settings["statistics"]["level"])
    note = (
        f"Fraction of the measured instants inside the band of nominally {level:g} (quantiles of "
        "the members), and its mean width in measured SD; means over all cells."
    )
    if calibrated:
        found = result.groups["calibration"].sel(ensemble=model)
        made = "these quantiles, moved outwards by a margin found"
        if "floor" in found:
            scale = "a scale learnt from spread, horizon and waves" * ("law" in found)
            made = (
                f"the mean, and a factor times {scale or 'the spread of the members'} (with a "
                "floor of a quarter of the root mean square error) to either side, found"
            )
        note += (
            f" Calibrated: {made} on training data that "
            "the members had not read, in windows as long as the first test set's. "
            + _other_lengths(result)
            + _calibrated_on(found, level)
            + "The margin guarantees nothing in another kind of sea."
        )
    if true:
        note += (
            " In brackets, of the true instants. The truth is the virtual tank's, without noise or "
            "slap; rates are not filtered."
        )
    title = f"Coverage of the {words}{100 * level:g} % band, {model_words(model)}"
    return by_channel(result, f"coverage_{prefix}{model}", title, heads, cells, note)


def _other_lengths(result: StudyResult) -> str:
    """Sentence on test sets whose windows are not as long as those that the margin is for."""
    lengths = {test: float(each["length"]) for test, each in result.settings["tests"].items()}
    first = next(iter(result.tests))
    others = [
        f"{result.label_of(test)} ({lengths[test]:g} T̂)"
        for test in result.tests
        if lengths[test] != lengths[first]
    ]
    if not others:
        return ""
    return f"Those are {lengths[first]:g} T̂ long; the margin is not made for {', '.join(others)}. "


def _calibrated_on(found: xr.Dataset, level: float) -> str:
    """Sentence on how much the calibration of a study rests on."""
    windows = found["windows"].values
    if not windows.all():
        return "Some training sets hold no such window. "
    said = (
        f"A training set had {_range_of(windows)} of them; allowing for their dependence, their "
        f"scores are worth {_range_of(found['blocks'].values)} independent ones. "
    )
    warranted = float(found["warranted"].min())
    if warranted < level:
        said += f"Of some channels that is too few: {warranted:.2f} is guaranteed there. "
    return said


def _range_of(values: np.ndarray[Any, Any]) -> str:
    low, high = (f"{float(each):.0f}" for each in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def densities(result: StudyResult) -> Section:
    """Return densities of measurement and forecasts, and their divergence."""
    ensembles = _ensembles(result)
    figures = tuple(
        Drawing(
            f"densities_{model}",
            f"Densities of measurement and {model_words(model)} forecast with the 95 % bands of "
            "their moving-block bootstrap (paper's settings); area 1 each, no common height.",
            partial(density_figure, result, model),
        )
        for model in (ensembles or result.models[:1])
    )
    order = sorted(judged_models(result), key=lambda model: model not in ensembles)
    tables = tuple(divergence_table(result, m, variant) for m in order for variant in VARIANTS)
    return Section("densities", "Densities and their divergence", figures=figures, tables=tables)


def divergence_table(result: StudyResult, model: str, variant: str) -> Table:
    """Jensen–Shannon divergence per channel beside its noise floor and, if asked, the paper's."""
    data = result.groups["statistics/divergence"]
    at = data.sel(model=model, variant=variant)
    numbers = ("mean", "lower", "upper", "uncertainty", "noise_floor")
    comparable = result.is_ensemble(model) and result.shows_paper
    paper = PUBLISHED if comparable else {}
    none = (MISSING,) * 4 if comparable else ()

    def cells(name: str) -> list[str]:
        of_all = name == "average"
        one = at.mean("channel", skipna=False) if of_all else at.sel(channel=name)
        block = "" if of_all else number(one["block_length"], 0)
        return [*(small_number(one[key]) for key in numbers), block, *paper.get(name, none)]

    quantiles = ("EV", "q0.025", "q0.975", "U")
    heads = (*quantiles, "noise floor", "block (samples)")
    published = tuple(f"paper: {each}" for each in quantiles) if comparable else ()
    test = result.label_of(str(data.attrs["test"]))
    how = "blocks may cross joins, block length and bandwidth as printed in the paper"
    if variant == "recommended":
        how = "no block crosses a join, Politis–White blocks, Silverman's bandwidth"
    return by_channel(
        result,
        f"jsd_{model}_{variant}",
        f"Divergence of the densities, {model_words(model)}, {test}: {variant} variant",
        (*heads, *published),
        cells,
        f"Nats, 0 to ln 2; {how}. The noise floor is the divergence of the measurement from "
        "itself under two independent bootstraps: what a record of this length cannot tell from "
        "none." + " The paper's columns are of another vessel in another tank." * comparable,
        elsewhere=[1 + len(heads) + k for k in range(len(published))],
        folded=not result.is_ensemble(model) and any(map(result.is_ensemble, result.models)),
    )


def members(result: StudyResult) -> Section | None:
    """Return errors of the members of ensembles over what was drawn, and eigenvalues."""
    figures = [
        Drawing(
            f"hyperparameters_{model}",
            f"Median ANRMSE of each member of the {model_words(model)} ensemble over all cells, "
            "against what was drawn for it, with Spearman's rank correlation.",
            partial(hyperparameter_figure, result, model),
        )
        for model in _ensembles(result)
    ]
    if any(name.startswith("eigenvalues/") for name in result.groups):
        figures.append(
            Drawing(
                "eigenvalues",
                "Eigenvalues of the models of the first training set: upper half of the complex "
                "plane, and modulus against frequency. A modulus of 1 neither grows nor decays; "
                f"those below {LOWEST:g} are left out on the right.",
                partial(eigenvalue_figure, result),
            )
        )
    return (
        Section("members", "Members of the ensemble", figures=tuple(figures)) if figures else None
    )


def service(result: StudyResult) -> Section | None:
    """Return errors against lead time of models that were judged in service."""
    groups = {model: result.groups.get(f"nowcast/{model}") for model in result.models}
    found = {model: each for model, each in groups.items() if each is not None}
    if not found:
        return None
    first = next(iter(found.values()))
    runs = [str(name) for name in first["run"].values]
    figures = [
        Drawing(
            f"nowcast_{run}",
            f"{run}: root mean square error in service against lead time, and what the model "
            f"claims of it, over {int(first.attrs['starts'])} forecasts.",
            partial(nowcast_figure, found, run),
        )
        for run in runs
    ]
    words = (
        "Models of the first training set, played sample by sample. Waves after a start are "
        "predicted from what the probes have measured until then."
    )
    return Section(
        "service",
        "In service",
        (words,),
        figures=tuple(figures),
        tables=tuple(nowcast_blocks(found)),
    )
