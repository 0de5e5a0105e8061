"""Beyond one number per cell: age of a forecast, band, densities, members, service."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from seakeep.report.comparison import nowcast_blocks
from seakeep.report.figures.errors import (
    BAND_WORDS,
    LOWEST,
    density_figure,
    eigenvalue_figure,
    error_over_time_figure,
    hyperparameter_figure,
    nowcast_figure,
)
from seakeep.report.page import Drawing, Section
from seakeep.report.sections.summary import by_channel, conditional
from seakeep.report.style import judged_models, model_words
from seakeep.report.tables import (
    MISSING,
    Table,
    beside,
    number,
    probability,
    short,
    small_number,
)
from seakeep.study import StudyResult
from seakeep.study.judge import VARIANTS

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
    return Section("time", title, figures=(figure,), tables=(_trend_table(result, split),))


def _trend_table(result: StudyResult, split: float) -> Table:
    rows, trend = [], result.groups["statistics/trend"]
    seconds = split * float(result.attrs["encounter_period"])
    for test in result.tests:
        for band, words in BAND_WORDS.items():
            for model in judged_models(result):
                at = trend.sel(test=test, model=model, band=band)
                rows.append(
                    (
                        result.label_of(test),
                        words,
                        model_words(model),
                        number(at["error_mean"].mean()),
                        number(at["change"]),
                        beside(at["slope"], at["lower"], at["upper"], form=small_number),
                        number(at["kendall_tau"], 2),
                        probability(at["p_value"]),
                    )
                )
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
        f"at a period of {split:g} T̂ ({seconds:.2f} s) into slow drift and waves; both are "
        "counted in SDs of the whole measured channel." + conditional(result),
    )  # fmt: skip


def coverage(result: StudyResult) -> Section | None:
    """Return coverage and width of the bands of ensembles."""
    kinds = (False, True) if result.is_calibrated else (False,)
    ensembles = filter(result.is_ensemble, result.models)
    tables = [coverage_table(result, model, kind) for model in ensembles for kind in kinds]
    return Section("coverage", "Coverage of the band", tables=tables) if tables else None


def coverage_table(result: StudyResult, model: str, calibrated: bool = False) -> Table:
    """Coverage and width of the members' band, or of the calibrated one, per test and channel."""
    prefix, words = ("calibrated_", "calibrated ") if calibrated else ("", "")
    found = result.groups["statistics/coverage"].sel(model=model)
    true = "truth" in found["against"].values
    kinds, two = ("inside" + " [of the truth]" * true, "width [SD]"), partial(number, digits=2)

    def cells(name: str) -> Iterator[str]:
        for test in result.tests:
            at = found.sel(test=test, channel=name)
            inside, width = (at[f"{prefix}{key}"] for key in ("inside", "relative_width"))
            yield beside(*inside, form=two) if true else two(*inside)
            yield two(width.sel(against="measured"))

    level = float(result.settings["statistics"]["level"])
    note = (
        f"Fraction of the measured instants inside the band of nominally {level:g} (quantiles of "
        "the members), and its mean width in measured SD; means over all cells."
    )
    if calibrated:
        note += _calibrated_words(result, model, level)
    if true:
        note += (
            " In brackets, of the true instants. The truth is the virtual tank's, without noise or "
            "slap; rates are not filtered."
        )
    heads = [f"{result.label_of(test)}: {each}" for test in result.tests for each in kinds]
    title = f"Coverage of the {words}{short(100 * level)} % band, {model_words(model)}"
    return by_channel(result, f"coverage_{prefix}{model}", title, heads, cells, note)


def _calibrated_words(result: StudyResult, model: str, level: float) -> str:
    """How the calibrated band is made, what it rests on, and where it is of no use."""
    found = result.groups["calibration"].sel(ensemble=model)
    made = "these quantiles, moved outwards by a margin found"
    if "floor" in found:
        learnt = "law" in found
        scale = (
            "a scale learnt from spread, horizon and waves"
            if learnt
            else "the spread of the members"
        )
        made = (
            f"the mean, and a factor times {scale} (with a "
            "floor of a quarter of the root mean square error) to either side, found"
        )
    said = (
        f" Calibrated: {made} on training data that the members had not read, in windows as long "
        "as the first test set's. "
    )
    lengths = {test: float(each["length"]) for test, each in result.settings["tests"].items()}
    first = lengths[next(iter(result.tests))]
    others = [f"{result.label_of(k)} ({n:g} T̂)" for k, n in lengths.items() if n != first]
    if others:
        said += f"Those are {first:g} T̂ long; the margin is not made for {', '.join(others)}. "
    if not found["windows"].all():
        said += "Some training sets hold no such window. "
    else:
        windows, blocks = (
            " to ".join(dict.fromkeys(f"{each:.0f}" for each in (values.min(), values.max())))
            for values in (found["windows"].values, found["blocks"].values)
        )
        said += (
            f"A training set had {windows} of them; allowing for their dependence, their "
            f"scores are worth {blocks} independent ones. "
        )
        if (warranted := float(found["warranted"].min())) < level:
            said += f"Of some channels that is too few: {warranted:.2f} is guaranteed there. "
    return said + "The margin guarantees nothing in another kind of sea."


def densities(result: StudyResult) -> Section:
    """Return densities of measurement and forecasts, and their divergence."""
    ensembles = [model for model in result.models if result.is_ensemble(model)]
    figures = [
        Drawing(
            f"densities_{model}",
            f"Densities of measurement and {model_words(model)} forecast with the 95 % bands of "
            "their moving-block bootstrap (paper's settings); area 1 each, no common height.",
            partial(density_figure, result, model),
        )
        for model in (ensembles or result.models[:1])
    ]
    order = sorted(judged_models(result), key=lambda model: model not in ensembles)
    tables = [divergence_table(result, m, variant) for m in order for variant in VARIANTS]
    return Section("densities", "Densities and their divergence", figures=figures, tables=tables)


def divergence_table(result: StudyResult, model: str, variant: str) -> Table:
    """Jensen–Shannon divergence per channel beside its noise floor and, if asked, the paper's."""
    data = result.groups["statistics/divergence"]
    at = data.sel(model=model, variant=variant)
    keys = ("mean", "lower", "upper", "uncertainty", "noise_floor")
    comparable = result.is_ensemble(model) and result.shows_paper

    def cells(name: str) -> Iterator[str]:
        of_all = name == "average"
        one = at.mean("channel", skipna=False) if of_all else at.sel(channel=name)
        yield from (small_number(one[key]) for key in keys)
        yield "" if of_all else number(one["block_length"], 0)
        if comparable:
            yield from PUBLISHED.get(name, (MISSING,) * 4)

    quantiles = ("EV", "q0.025", "q0.975", "U")
    heads = [*quantiles, "noise floor", "block (samples)"]
    published = [f"paper: {each}" for each in quantiles] if comparable else []
    test = result.label_of(str(data.attrs["test"]))
    how = "blocks may cross joins, block length and bandwidth as printed in the paper"
    if variant == "recommended":
        how = "no block crosses a join, Politis–White blocks, Silverman's bandwidth"
    return by_channel(
        result,
        f"jsd_{model}_{variant}",
        f"Divergence of the densities, {model_words(model)}, {test}: {variant} variant",
        [*heads, *published],
        cells,
        f"Nats, 0 to ln 2; {how}. The noise floor is the divergence of the measurement from "
        "itself under two independent bootstraps: what a record of this length cannot tell from "
        "none." + " The paper's columns are of another vessel in another tank." * comparable,
        elsewhere=range(1 + len(heads), 1 + len(heads) + len(published)),
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
        for model in filter(result.is_ensemble, result.models)
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
    return Section("members", "Members of the ensemble", figures=figures) if figures else None


def service(result: StudyResult) -> Section | None:
    """Return errors against lead time of models that were judged in service."""
    groups = {model: result.groups.get(f"nowcast/{model}") for model in result.models}
    found = {model: each for model, each in groups.items() if each is not None}
    if not found:
        return None
    first = next(iter(found.values()))
    figures = [
        Drawing(
            f"nowcast_{run}",
            f"{run}: root mean square error in service against lead time, and what the model "
            f"claims of it, over {int(first.attrs['starts'])} forecasts.",
            partial(nowcast_figure, found, str(run)),
        )
        for run in first["run"].values
    ]
    words = (
        "Models of the first training set, played sample by sample. Waves after a start are "
        "predicted from what the probes have measured until then."
    )
    tables = [*nowcast_blocks(found)]
    return Section("service", "In service", (words,), figures=figures, tables=tables)
