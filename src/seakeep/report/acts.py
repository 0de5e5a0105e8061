"""The page over the acts of ``seakeep reproduce``: side by side, and against the paper's claims."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import binomtest

from seakeep.arrays import FloatArray, Progress, undefined
from seakeep.core.spectra import split_bands
from seakeep.metrics import slack_share
from seakeep.report.figures.histories import acts_figure
from seakeep.report.page import Section, drawing, section, write_page
from seakeep.report.sections.data import finished, wave_tables
from seakeep.report.sections.results import conditional, divergence_table
from seakeep.report.style import model_words
from seakeep.report.tables import WORDS, Interval, Number, Table, number, numbers, ratio_of, table
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import (
    Statistic,
    average_of,
    blocks_of,
    median_of,
    phase_leads,
    training_order,
    with_bounds,
)
from seakeep.study.plan import random_stream
from seakeep.study.reproduce import ACTS, NOTE, SLOW, Act

Results = Mapping[str, StudyResult]
Judged = tuple[str, bool | None]
"""Our number, and whether the claim holds: None where the study cannot tell."""

LOADS = ("mooring_bow", "mooring_stern")
SEA, REGULAR = ("irregular",), ("regular_1_5", "regular_2", "regular_3")
USEFUL = 0.5
"""Median NRMSE below which a forecast counts as accurate: three quarters of the variance."""
AGED = 0.2
"""Part of the mean error by which it may change over a window without a trend worth the word."""
ALMOST = 0.9
"""Share that counts as almost always."""
SLACKER = 0.01
"""Part of the time by which two lines must differ in being slack."""
SINGLE, ENSEMBLE = "deterministic", "bayesian"
PAPER = ("nrmse", "nammae")
"""The measures of the claims."""


def claims_table(results: Results) -> Table:
    """Each claim, our figure, and whether it holds, in the first act."""
    verdicts = {True: "holds", False: "does not", None: "cannot tell"}
    acts, rows = Claims(results["paper"], Evidence(results["raw"])), []
    for key, (claim, how) in WORDS["claims"].items():
        figure, holds = acts.judge(key)
        judged = how.format(useful=USEFUL, aged=100 * AGED, almost=100 * ALMOST)
        rows.append((claim, figure, verdicts[holds], judged))
    return table("claims", rows)


def all_of(verdicts: Iterable[bool | None]) -> bool | None:
    """Whether all hold: not if one does not, unknown if one is.

    Examples
    --------
    >>> all_of([True, True]), all_of([True, None]), all_of([None, False])
    (True, None, False)
    """
    known = list(verdicts)
    return False if False in known else None if None in known else True


@dataclass(frozen=True, eq=False)
class Evidence:
    """Cells of an act in some seas, training sets in the order of their runs, and statistics.

    Parameters
    ----------
    result : StudyResult
        The act.
    seas : sequence of str, optional
        Test sets, whose windows follow each other; by default the irregular one.
    """

    result: StudyResult
    seas: Sequence[str] = field(default=SEA, kw_only=True)

    def among(self, *seas: str) -> "Evidence":
        """Return the evidence of the act in other seas."""
        return Evidence(self.result, seas=seas)

    @property
    def tests(self) -> list[xr.Dataset]:
        """Test sets of the seas."""
        return [self.result.tests[sea] for sea in self.seas]

    @property
    def motions(self) -> list[str]:
        """Channels that are no loads."""
        return [name for name in self.result.channels if name not in LOADS]

    def ordered(self, data: xr.DataArray) -> FloatArray:
        """Values over (training, window, …), training sets run by run."""
        order, _ = training_order(self.result.groups["training"])
        return data.transpose("training", "window", ...).values[order]

    def cells(
        self, channels: Sequence[str] = (), measure: str = "nrmse", model: str = ENSEMBLE
    ) -> FloatArray:
        """Errors over (training, window), averaged over channels; NaN where none is judged."""
        names = list(channels or self.result.channels)
        at = {"model": model, "measure": measure, "channel": names}
        errors = (test["error"].where(test["judged"]).sel(at) for test in self.tests)
        return np.concatenate([self.ordered(each.mean("channel")) for each in errors], axis=1)

    def interval(self, statistic: Statistic, *cells: FloatArray, signed: bool = False) -> Interval:
        """A statistic of cells (training, window, …) with its interval."""
        blocks = blocks_of(self.tests, self.result.groups["training"])
        rng = random_stream(int(self.result.attrs["seed"]), "claims")
        numbers = with_bounds(statistic, *cells, rng=rng, blocks=blocks, signed=signed)
        return Interval(*map(float, numbers))

    def error(self, *of: Any, **named: str) -> Interval:
        """Median of the errors of :meth:`cells`."""
        return self.interval(_median, self.cells(*of, **named))

    def variant(self, key: str, variant: str) -> FloatArray:
        """A number of the model with λ, without, or truncated, over (training, 1)."""
        data = self.result.groups[f"regularisation/{SINGLE}"][key].sel(variant=variant)
        return self.ordered(data.expand_dims("window"))


def _mean(drawn: FloatArray) -> FloatArray:
    """Average over all cells of each series."""
    return average_of(drawn.reshape(len(drawn), -1))


def _median(drawn: FloatArray) -> FloatArray:
    """Median over all cells of each series."""
    return median_of(drawn.reshape(len(drawn), -1))


def _spread(drawn: FloatArray) -> FloatArray:
    """Inter-quartile range over all cells of each series."""
    low, high = np.nanquantile(drawn, [0.25, 0.75], axis=(1, 2))
    return high - low


def _share(act: Evidence, measure: str, channels: Sequence[str]) -> Interval:
    """Fraction of the average error that some channels make."""
    picked = np.isin(act.result.channels, channels)
    (test,) = act.tests
    errors = test["error"].where(test["judged"]).sel(model=ENSEMBLE, measure=measure)

    def statistic(drawn: FloatArray) -> FloatArray:
        means = average_of(drawn.reshape(len(drawn), -1, drawn.shape[-1]).swapaxes(1, 2))
        return means[:, picked].sum(axis=1) / np.nansum(means, axis=1)

    return act.interval(statistic, act.ordered(errors))


def _ratio(statistic: Statistic) -> Statistic:
    """A statistic of one model over that of another."""

    def ratio(drawn: FloatArray, other: FloatArray) -> FloatArray:
        with undefined():  # a redraw may hold one cell alone
            return statistic(drawn) / statistic(other)

    return ratio


def _against_single(act: Evidence, statistic: Statistic = _median) -> list[Interval]:
    """A statistic of the ensemble over that of the single model, in both measures."""
    pairs = [(act.cells((), key, ENSEMBLE), act.cells((), key, SINGLE)) for key in PAPER]
    return [act.interval(_ratio(statistic), ours, other) for ours, other in pairs]


def _changes(nrmse: Interval, nammae: Interval) -> str:
    """Text of the changes of both measures."""
    return f"ANRMSE {nrmse.change()}, NAMMAE {nammae.change()}"


def _band(act: Evidence, channels: Sequence[str]) -> list[Interval]:
    """Part of the instants inside the band of irregular waves, and its width in window SDs."""
    at = act.tests[0].sel(channel=list(channels), ensemble=ENSEMBLE)
    measured, lower, upper = (at[key] for key in ("measured", "lower", "upper"))
    inside = ((measured >= lower) & (measured <= upper)).mean("time")
    width = (upper - lower).mean("time", skipna=False) / measured.std("time", ddof=1)
    both = (act.ordered(each.where(at["judged"])) for each in (inside, width))
    return [act.interval(_mean, each) for each in both]


def _slack(act: Evidence, line: str) -> Interval:
    """Part of the time at which a line is slack in the windows of a test set."""
    data = act.tests[0].sel(channel=line)
    loads = zip(data["measured"].values, data["noise_std"].values, strict=True)
    return act.interval(_mean, np.array([[slack_share(*each) for each in loads]]))


@dataclass(frozen=True, eq=False)
class Claims(Evidence):
    """What judges each claim by the first act: a method of the name that it has in ``words.toml``.

    Parameters
    ----------
    result : StudyResult
        The first act.
    raw : Evidence
        The second.
    """

    raw: Evidence

    def judge(self, claim: str) -> Judged:
        """Our number, and whether the claim holds."""
        return getattr(self, f"_{claim}")()

    def _robust(self) -> Judged:
        own, fir = (self.error(model=model) for model in (ENSEMBLE, "fir"))
        worst = float(np.nanmax(self.cells()))
        words = f"median ANRMSE {own.text()}, worst cell {worst:.2f}; FIR {fir.text()}"
        return words, all_of([own.below(USEFUL), worst < 1.0])

    def _trend(self) -> Judged:
        growths = []
        for act in (self, self.raw):
            at = act.result.groups["statistics/trend"].sel(test="irregular", band="all")
            growths.append([ratio_of(at.sel(model=model)) for model in (SINGLE, ENSEMBLE)])
        texts = (" and ".join(each.growth() for each in of_act) for of_act in growths)
        within = [v for e in growths[0] for v in (e.below(1 + AGED), e.above(1 - AGED))]
        return "{}; act (b): {}".format(*texts), all_of(within)

    def _any_length(self) -> Judged:
        period = self.result.encounter_period
        length = self.tests[0]["time"].values[-1]
        return f"{length / period:.0f} T̂ were forecast, as in the paper", None

    def _who_errs(self) -> Judged:
        nrmse, nammae = (_share(self, key, LOADS) for key in PAPER)
        slow = _share(self.raw, "nrmse", SLOW).part()
        words = (
            f"loads make {nrmse.part()} of ANRMSE, {nammae.part()} of NAMMAE; act (b): surge and "
            f"loads {slow} of ANRMSE"
        )
        return words, all_of([nrmse.above(0.5), nammae.above(0.5)])

    def _load_divergence(self) -> Judged:
        at = self.result.groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
        loads, others = (at.sel(channel=[*k]).mean("channel") for k in (LOADS, self.motions))
        pairs = (("mean", "mean"), ("lower", "upper"), ("upper", "lower"))
        ratio = Interval(*(float(loads[a] / others[b]) for a, b in pairs))
        words = (
            f"{float(loads['mean']):.4f} against {float(others['mean']):.4f}: a factor of "
            f"{ratio.value:.0f} [{ratio.lower:.1f}, {ratio.upper:.0f}]"
        )
        return words, ratio.above(10**0.5)

    def _densities(self) -> Judged:
        at = self.result.groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
        within = (at["mean"] <= at["noise_floor_upper"]).sel(channel=self.motions).values
        count, total = int(within.sum()), within.size
        share = Interval(count / total, *binomtest(count, total).proportion_ci())
        words = f"{count} of {total} motions within the noise of the record: {share.part()}"
        return words, share.above(ALMOST)

    def _better(self, statistic: Statistic = _median) -> Judged:
        changes = _against_single(self, statistic)
        return _changes(*changes), all_of(each.below(1.0) for each in changes)

    def _always_better(self) -> Judged:
        differences = [
            each.below(1.0)
            for test in self.result.tests
            for each in _against_single(self.among(test))
        ]
        better, worse, unknown = map(differences.count, (True, False, None))
        words = (
            f"better in {better}, worse in {worse}, undecided in {unknown} of {len(differences)}"
        )
        return words, all_of(differences)

    def _narrow(self) -> Judged:
        inside, width = _band(self, self.motions)
        error = self.error(self.motions).value
        words = f"motions: {width.text()} SD wide, {inside.part()} of the instants inside 95 %"
        return f"{words}; median error {error:.2f} SD", width.below(USEFUL)

    def _load_band(self) -> Judged:
        inside, _ = _band(self, LOADS)
        return f"{inside.part()} of the instants of the loads inside 95 %", inside.below(0.9)

    def _slow_loads(self) -> Judged:
        result = self.raw.result
        edge = 1 / (result.settings["statistics"]["split_period"] * result.encounter_period)
        test = self.raw.tests[0].sel(channel=list(LOADS), model=ENSEMBLE)
        both = test["measured"].values, self.raw.ordered(test["mean"])
        measured, forecast = (split_bands(values, result.dt, edge)[0] for values in both)
        errors = np.sqrt(np.mean((forecast - measured) ** 2, axis=2)) / measured.std(axis=1)
        bow, stern = (self.raw.interval(_median, errors[..., k]) for k in range(2))
        words = f"act (b): bow {bow.text()}, stern {stern.text()}"
        return words, all_of([bow.below(1.0), stern.below(1.0)])

    def _peaks(self) -> Judged:
        loads = self.error(LOADS, "nammae")
        return f"median NAMMAE of the loads {loads.text()} SD", loads.below(1.0)

    def _regular(self) -> Judged:
        waves = [*map(self.among, REGULAR)]
        both = [[each.error(k) for each in waves] for k in (self.motions, LOADS)]
        motions, loads = (", ".join(each.text() for each in group) for group in both)
        better = [a.below(b) for a, b in zip(*both, strict=True)]
        holds = all_of([*(each.below(USEFUL) for each in both[0]), *better])
        return f"λ/L 1.5, 2, 3: motions {motions}; loads {loads}", holds

    def _against_irregular(self) -> Judged:
        both = self.among(*SEA, *REGULAR)
        sizes = [test.sizes["window"] for test in both.tests]
        is_regular = np.repeat([False, *[True] * len(REGULAR)], sizes)
        changes = []
        for key in PAPER:
            cells = both.cells((), key)
            parts = (np.where(part, cells, np.nan) for part in (is_regular, ~is_regular))
            changes.append(both.interval(_ratio(_median), *parts))
        nrmse, nammae = changes
        return _changes(nrmse, nammae), all_of([nrmse.above(1.0), nammae.below(1.0)])

    def _phase(self) -> Judged:
        leads = [np.abs(phase_leads(self.result.groups, test, ENSEMBLE)) for test in REGULAR]
        order, _ = training_order(self.result.groups["training"])
        cells, is_load = np.concatenate(leads, axis=1)[order], np.isin(self.result.channels, LOADS)
        both, interval = (cells[..., is_load], cells[..., ~is_load]), self.among(*REGULAR).interval
        loads, motions = (interval(_median, each).text(0, "°") for each in both)
        more = interval(lambda a, b: _median(a) - _median(b), *both, signed=True)
        return f"median |phase|: loads {loads}, motions {motions}", more.above(0.0)

    def _stern(self) -> Judged:
        line = "mooring_stern"
        errors = [self.among(test).error((line,)) for test in REGULAR]
        slack = [_slack(self.raw.among(test), line) for test in REGULAR]
        falls = [
            longer.below(shorter)
            for (shorter, wet), (longer, dry) in pairwise(zip(errors, slack, strict=True))
            if dry.upper + SLACKER < wet.lower and np.isfinite([longer.value, shorter.value]).all()
        ]
        listed = ", ".join(e.text() if np.isfinite(e.value) else "only noise" for e in errors)
        parts = ", ".join(each.part() for each in slack)
        return f"NRMSE {listed}; slack {parts} of the time", all_of(falls) if falls else None

    def _stable(self) -> Judged:
        radii = (self.variant("radius", each) for each in ("ridge", "none"))
        ours, none = (self.interval(_median, each) for each in radii)
        words = f"spectral radius {ours.text()} with λ, {none.text()} without"
        return words, all_of([ours.below(1.0), none.above(1.0)])

    def _cheaper(self) -> Judged:
        svd, ours = (self.variant("seconds", each) for each in ("truncated", "ridge"))
        times = self.interval(_median, svd / ours)
        return f"the SVD takes {times.text(0)} times as long", times.above(1.0)

    def _robust_to_noise(self) -> Judged:
        data = self.result.groups[f"regularisation/{SINGLE}"]
        truncated = self.ordered(data["truncated_nrmse"].mean("channel"))
        ratio = self.interval(_ratio(_median), self.cells(model=SINGLE), truncated)
        rank = int(data["rank"].median())
        return f"ANRMSE {ratio.change()} from {rank} singular values to λ", ratio.below(1.0)

    def _dispersion(self) -> Judged:
        return self._better(_spread)


def write_reproduction(folder: Path, results: Results, progress: Progress | None = None) -> Path:
    """Write the page over the acts; each act's own page is written by itself.

    Parameters
    ----------
    folder : Path
        Folder of the reproduction.
    results : mapping of str to StudyResult
        By act.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

    Returns
    -------
    Path
        The page.
    """
    every = list(results.values())
    first, last = every[0], every[-1]
    stamp = {
        "description": "A study of linear models with delays that forecast a moored vessel in head "
        "seas, on data of a virtual towing tank: six runs, three procedures.",
        "seed": last.attrs["seed"],
        "finished": finished(last),
    }
    short = short_table(results)
    repeats = [result.groups.get("repeats") for result in every]
    summary = section(
        "summary",
        drawing("acts", acts_figure, results),
        replace(short, note=f"{short.note} {still_water(results)}"),
        more=(finding(results), against_filter(results), NOTE),
        points=[f"{act.title}. {act.sentence}" for act, _ in _played(results)],
        # Once what several studies warn of.
        notices=list(dict.fromkeys(words_of_repeats(each) for each in repeats if each)),
    )
    sections = [summary]
    if {"paper", "raw"} <= set(results):
        sections.append(section("claims", claims_table(results)))
    divergence = divergence_table(first, "bayesian", "paper")
    title = "Divergence of the densities, beside the paper's"
    links = [(f"{act.name}/report.html", act.title) for act, _ in _played(results)]
    sections += [
        section("channels", acts_table(results)),
        Section("densities", title, tables=(divergence,)),
        section("waves", *wave_tables(first)),
        section("studies", links=links),
    ]
    return write_page(folder, "The paper's study on the virtual tank", stamp, sections, progress)


def _played(results: Results) -> list[tuple[Act, StudyResult]]:
    return [(act, results[act.name]) for act in ACTS if act.name in results]


def short_table(results: Results) -> Table:
    """Median errors on the channels as measured: the models, and the best that compare with them.

    Parameters
    ----------
    results : mapping of str to StudyResult
        By act.

    Returns
    -------
    Table
        At most six rows; a cell holds the error of the wave channels and of the slow ones.
    """
    last = list(results)[-1]
    rows = [
        (said, *(Number(" / ".join(pair)) for pair in _pairs(results[act], model)))
        for act, model, said in (*WORDS["rows"], (last, "hold_last", "last measured state"))
        if act in results
    ]
    seas = map(results[last].sea_of, results[last].tests)
    return table("short", rows, columns=("model", *seas))


def finding(results: Results) -> str:
    """The conclusion on irregular waves in one sentence, with 95 % intervals."""
    still = Evidence([*results.values()][-1]).error(model="hold_last").text()
    words = {
        "recommended": "the recommended model errs {} SD of the measurement",
        "raw": "the paper's procedure errs {} on the channels as measured",
        "paper": "and {} without the slow drift",
    }
    parts = [
        each.format(Evidence(results[act]).error(model=SINGLE).text())
        for act, each in words.items()
        if act in results
    ]
    return f"In irregular waves {', '.join(parts)}; the last measured state errs {still}."


def against_filter(results: Results) -> str:
    """How the error differs between models and the filter beside them, in one sentence."""
    at = {"test": SEA[0], "model": SINGLE, "other": "fir", "measure": "nrmse", "channel": "average"}
    parts = [
        f"{ratio_of(result.groups['statistics/differences'].sel(at)).change()} in {act.letter}"
        for act, result in _played(results)
    ]
    return (
        "From the filter with the same data, look-ahead and input map (FIR, its length and λ "
        "chosen by validation) to the single model, the median error there changes by "
        f"{', '.join(parts)}."
    )


def still_water(results: Results) -> str:
    """Errors of surge in regular waves in metres: there the window's SD says little."""
    if (result := results.get("recommended")) is None:
        return ""
    parts = []
    for test in REGULAR:
        at = result.tests[test].sel(channel="surge")
        spread = at["measured"].std("time", ddof=1).median()
        error = at["error"].sel(model=SINGLE, measure="training_nrmse").where(at["judged"])
        metres = error.median() * at["training_std"].median()
        parts.append(f"{number(metres)} m ({number(spread)} m)")
    trained = number(at["training_std"].median())
    return (
        "In regular waves drift stands nearly still, at a mean far from that of the training. "
        f"There the recommended model errs by {', '.join(parts)} in surge at λ/L 1.5, 2 and 3; in "
        f"parentheses the SD of the window, by which NRMSE divides. In training surge has an SD of "
        f"{trained} m."
    )


def _pairs(result: StudyResult, model: str) -> list[list[Number]]:
    """Median errors of a model per sea, of the wave channels and of the slow ones."""
    slow, pairs = np.isin(result.channels, SLOW), []
    for test in result.tests:
        cells = result.errors(test, model)
        pairs.append(numbers([np.nanmedian(average_of(cells[:, k])) for k in (~slow, slow)], 2))
    return pairs


def acts_table(results: Results) -> Table:
    """Median errors of every model of every act, per sea, of wave-frequency and slow channels."""
    first = next(iter(results.values()))
    seas = [*map(first.sea_of, first.tests)]
    rows, conditions = [], []
    for act, result in _played(results):
        for model in result.models:
            rows.append((act.letter, model_words(model), *chain(*_pairs(result, model))))
        if words := conditional(result, result.models):
            conditions.append(f"{act.letter}:{words}")
    columns = ("act", "model", *(f"{sea}: {part}" for sea in seas for part in ("waves", "slow")))
    return table("acts", rows, more=" ".join(conditions), columns=columns)
