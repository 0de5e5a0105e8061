"""Claims of the paper's results and conclusions, checked against the acts of the reproduction."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from seakeep.arrays import FloatArray
from seakeep.core.bands import split_bands
from seakeep.core.metrics import slack_share
from seakeep.report.tables import Form, Table, number, signed, table, words
from seakeep.statistics import two_way_interval
from seakeep.study import StudyResult
from seakeep.study.judge import (
    average_of,
    band_of,
    blocks_of,
    median_of,
    phase_leads,
    training_order,
)
from seakeep.study.plan import random_stream
from seakeep.study.reproduce import SLOW

BOUNDS = ("change", "lower", "upper")
Results = Mapping[str, StudyResult]
Statistic = Callable[..., FloatArray]
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
MEASURES = {"nrmse": "ANRMSE", "nammae": "NAMMAE"}


class Interval(NamedTuple):
    """A number with its 95 % interval by two-way bootstrap; NaN where there is none."""

    value: float
    lower: float
    upper: float

    def below(self, bound: float) -> bool | None:
        """Whether it lies below a bound; None where the interval holds the bound."""
        return self.below_other(Interval(bound, bound, bound))

    def below_other(self, other: Interval) -> bool | None:
        """Whether it lies below another number; None where the intervals meet."""
        if self.upper < other.lower:
            return True
        return False if self.lower > other.upper else None

    def text(self, digits: int = 2, unit: str = "", factor: float = 1.0) -> str:
        """Text of the number times a factor, with its interval in brackets."""
        return self._text(partial(number, digits=digits), unit, [factor * x for x in self])

    def change(self) -> str:
        """Text of a ratio as a relative change."""
        return self._text(signed, " %", [100 * (x - 1) for x in self])

    def part(self) -> str:
        """Text of a share."""
        return self.text(0, " %", 100.0)

    def _text(self, form: Form, unit: str, values: Sequence[float]) -> str:
        value, low, high = map(form, values)
        return f"{value}{unit}" + f" [{low}, {high}]" * bool(np.isfinite(self.lower))


def claims_table(results: Results) -> Table:
    """Each claim, our figure, and whether it holds, in the first act."""
    verdicts = {True: "holds", False: "does not", None: "cannot tell"}
    rows = []
    for key, judge in CLAIMS.items():
        claim, how = words()["claims"][key]
        figure, holds = judge(results)
        limits = {"useful": USEFUL, "aged": 100 * AGED, "almost": 100 * ALMOST}
        rows.append((claim, figure, verdicts[holds], how.format(**limits)))
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


def opposite(verdict: bool | None) -> bool | None:
    """The verdict on the contrary."""
    return None if verdict is None else not verdict


def _cells(
    result: StudyResult,
    tests: Sequence[str],
    channels: Sequence[str] = (),
    measure: str = "nrmse",
    model: str = ENSEMBLE,
) -> FloatArray:
    """Errors over (training, window, channel), NaN where not judged; windows of all test sets."""
    order, _ = training_order(result.groups["training"])
    at = {"model": model, "measure": measure, "channel": list(channels or result.channels)}
    parts = [
        data["error"].where(data["judged"]).sel(at).values
        for data in (result.tests[test] for test in tests)
    ]
    return np.concatenate(parts, axis=1)[order]


def _interval(
    result: StudyResult,
    tests: Sequence[str],
    statistic: Statistic,
    *cells: FloatArray,
    signed: bool = False,
) -> Interval:
    """A statistic of cells (training, window, …) with its interval."""
    blocks = blocks_of([result.tests[test] for test in tests], result.groups["training"])
    rng = random_stream(int(result.attrs["seed"]), "claims")
    lower, upper = two_way_interval(statistic, *cells, rng=rng, blocks=blocks, signed=signed)
    value = statistic(*(each[None] for each in cells))[0]
    return Interval(float(value), float(lower), float(upper))


def _flat(drawn: FloatArray) -> FloatArray:
    """All cells of each series."""
    return drawn.reshape(len(drawn), -1)


def _middle(drawn: FloatArray) -> FloatArray:
    """Median over all cells of each series."""
    return median_of(_flat(drawn))


def _median(drawn: FloatArray) -> FloatArray:
    """Median over cells (series, training, window, channel) of the average over channels."""
    return _middle(average_of(drawn))


def _spread(drawn: FloatArray) -> FloatArray:
    """Inter-quartile range over cells of the average over channels."""
    low, high = np.nanquantile(_flat(average_of(drawn)), [0.25, 0.75], axis=1)
    out: FloatArray = high - low
    return out


def _columns(result: StudyResult, channels: Sequence[str]) -> list[int]:
    return [result.channels.index(name) for name in channels]


def _motions(result: StudyResult) -> list[str]:
    return [name for name in result.channels if name not in LOADS]


def error_of(result: StudyResult, tests: Sequence[str], *of: Any, **named: str) -> Interval:
    """Median of the errors of :func:`_cells`, averaged over the channels."""
    return _interval(result, tests, _median, _cells(result, tests, *of, **named))


def _robust(results: Results) -> Judged:
    result = results["paper"]
    own, fir = (error_of(result, SEA, model=model) for model in (ENSEMBLE, "fir"))
    worst = float(np.nanmax(average_of(_cells(result, SEA))))
    words = f"median ANRMSE {own.text()}, worst cell {worst:.2f}; FIR {fir.text()}"
    return words, all_of([own.below(USEFUL), worst < 1.0])


def _trend(results: Results) -> Judged:
    growths = {}
    for act in ("paper", "raw"):
        at = results[act].groups["statistics/trend"].sel(test="irregular", band="all")
        each = np.stack([at[key].sel(model=[SINGLE, ENSEMBLE]) for key in BOUNDS], axis=1)
        growths[act] = [Interval(*(1.0 + row)) for row in each]
    texts = (" and ".join(each.change() for each in of_act) for of_act in growths.values())
    within = [v for e in growths["paper"] for v in (e.below(1 + AGED), opposite(e.below(1 - AGED)))]
    return "{}; act (b): {}".format(*texts), all_of(within)


def _any_length(results: Results) -> Judged:
    period = float(results["paper"].attrs["encounter_period"])
    length = float(results["paper"].tests["irregular"]["time"].values[-1])
    return f"{length / period:.0f} T̂ were forecast, as in the paper", None


def _share(result: StudyResult, measure: str, channels: Sequence[str]) -> Interval:
    """Fraction of the average error that some channels make."""
    picked = _columns(result, channels)

    def statistic(drawn: FloatArray) -> FloatArray:
        means = average_of(drawn.reshape(len(drawn), -1, drawn.shape[-1]).swapaxes(1, 2))
        out: FloatArray = means[:, picked].sum(axis=1) / np.nansum(means, axis=1)
        return out

    return _interval(result, SEA, statistic, _cells(result, SEA, measure=measure))


def _who_errs(results: Results) -> Judged:
    shares = {words: _share(results["paper"], key, LOADS) for key, words in MEASURES.items()}
    raw = _share(results["raw"], "nrmse", SLOW)
    listed = ", ".join(f"{each.part()} of {words}" for words, each in shares.items())
    holds = all_of(opposite(each.below(0.5)) for each in shares.values())
    return f"loads make {listed}; act (b): surge and loads {raw.part()} of ANRMSE", holds


def _load_divergence(results: Results) -> Judged:
    at = results["paper"].groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
    loads, others = (
        at.sel(channel=list(names)).mean("channel") for names in (LOADS, _motions(results["paper"]))
    )
    pairs = (("mean", "mean"), ("lower", "upper"), ("upper", "lower"))
    ratio = Interval(*(float(loads[a] / others[b]) for a, b in pairs))
    words = (
        f"{float(loads['mean']):.4f} against {float(others['mean']):.4f}: a factor of "
        f"{ratio.value:.0f} [{ratio.lower:.1f}, {ratio.upper:.0f}]"
    )
    return words, opposite(ratio.below(10**0.5))


def _densities(results: Results) -> Judged:
    result = results["paper"]
    at = result.groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
    at = at.sel(channel=_motions(result))
    within, count = int((at["mean"] <= at["noise_floor_upper"]).sum()), at.sizes["channel"]
    share = Interval(within / count, *binomtest(within, count).proportion_ci())
    words = f"{within} of {count} motions within the noise of the record: {share.part()}"
    return words, opposite(share.below(ALMOST))


def _against_single(
    result: StudyResult, tests: Sequence[str], statistic: Statistic = _median
) -> dict[str, Interval]:
    """A statistic of the ensemble over that of the single model, in both measures."""

    def ratio(drawn: FloatArray, other: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):  # a redraw may hold one cell alone
            return statistic(drawn) / statistic(other)

    both = {
        key: [_cells(result, tests, (), key, m) for m in (ENSEMBLE, SINGLE)] for key in MEASURES
    }
    return {MEASURES[key]: _interval(result, tests, ratio, *each) for key, each in both.items()}


def _better(results: Results, statistic: Statistic) -> Judged:
    differences = _against_single(results["paper"], SEA, statistic)
    return _changes(differences), all_of(each.below(1.0) for each in differences.values())


def _always_better(results: Results) -> Judged:
    result = results["paper"]
    differences = [
        each.below(1.0)
        for test in result.tests
        for each in _against_single(result, (test,)).values()
    ]
    better, worse, unknown = (differences.count(each) for each in (True, False, None))
    return (
        f"better in {better}, worse in {worse}, undecided in {unknown} of {len(differences)}",
        all_of(differences),
    )


def _band(result: StudyResult, channels: Sequence[str]) -> list[Interval]:
    """Part of the instants inside the band of irregular waves, and its width in window SDs."""
    test, picked = result.tests["irregular"], _columns(result, channels)
    order, _ = training_order(result.groups["training"])
    lower, upper = (bound[order][..., picked] for bound in band_of(test, ENSEMBLE, None))
    measured = test["measured"].values[..., picked]
    inside = ((measured >= lower) & (measured <= upper)).mean(axis=2)
    width = (upper - lower).mean(axis=2) / measured.std(axis=1, ddof=1)
    cells = (np.where(test["judged"].values[order][..., None], x, np.nan) for x in (inside, width))
    return [_interval(result, SEA, lambda drawn: average_of(_flat(drawn)), each) for each in cells]


def _narrow(results: Results) -> Judged:
    inside, width = _band(results["paper"], _motions(results["paper"]))
    error = error_of(results["paper"], SEA, _motions(results["paper"])).value
    words = f"motions: {width.text()} SD wide, {inside.part()} of the instants inside 95 %"
    return f"{words}; median error {error:.2f} SD", width.below(USEFUL)


def _load_band(results: Results) -> Judged:
    inside, _ = _band(results["paper"], LOADS)
    return f"{inside.part()} of the instants of the loads inside 95 %", inside.below(0.9)


def _slow_loads(results: Results) -> Judged:
    result = results["raw"]
    test, picked = result.tests["irregular"], _columns(result, LOADS)
    split = float(result.settings["statistics"]["split_period"])
    frequency = 1 / (split * float(result.attrs["encounter_period"]))
    order, _ = training_order(result.groups["training"])
    measured, forecast = (
        split_bands(values[..., picked], float(result.attrs["dt"]), frequency)[0]
        for values in (test["measured"].values, test["mean"].sel(model=ENSEMBLE).values[order])
    )
    errors = np.sqrt(np.mean((forecast - measured) ** 2, axis=2)) / measured.std(axis=1)
    by_statistic = {
        name.removeprefix("mooring_"): _interval(result, SEA, _median, errors[..., [k]])
        for k, name in enumerate(LOADS)
    }
    words = ", ".join(f"{name} {each.text()}" for name, each in by_statistic.items())
    return f"act (b): {words}", all_of(each.below(1.0) for each in by_statistic.values())


def _peaks(results: Results) -> Judged:
    loads = error_of(results["paper"], SEA, LOADS, "nammae")
    return f"median NAMMAE of the loads {loads.text()} SD", loads.below(1.0)


def _regular(results: Results) -> Judged:
    result = results["paper"]
    motions, loads = (
        [error_of(result, (test,), names) for test in REGULAR]
        for names in (_motions(result), LOADS)
    )
    words = [", ".join(each.text() for each in group) for group in (motions, loads)]
    better = [a.below_other(b) for a, b in zip(motions, loads, strict=True)]
    holds = all_of([*(each.below(USEFUL) for each in motions), *better])
    return f"λ/L 1.5, 2, 3: motions {words[0]}; loads {words[1]}", holds


def _against_irregular(results: Results) -> Judged:
    result, tests = results["paper"], (*SEA, *REGULAR)
    sizes = [result.tests[test].sizes["window"] for test in tests]
    regular = np.repeat([False, *[True] * len(REGULAR)], sizes)
    shape = (result.groups["training"].sizes["training"], regular.size)
    labels = np.broadcast_to(regular, shape).astype(float)

    def ratio(drawn: FloatArray, label: FloatArray) -> FloatArray:
        averages, kind = _flat(average_of(drawn)), _flat(label) > 0.5
        ours, sea = (median_of(np.where(part, averages, np.nan)) for part in (kind, ~kind))
        return ours / sea

    differences = {
        words: _interval(result, tests, ratio, _cells(result, tests, measure=key), labels)
        for key, words in MEASURES.items()
    }
    return _changes(differences), all_of(
        [opposite(differences["ANRMSE"].below(1.0)), differences["NAMMAE"].below(1.0)]
    )


def _phase(results: Results) -> Judged:
    result = results["paper"]
    order, _ = training_order(result.groups["training"])
    leads = [np.abs(phase_leads(result.groups, test, ENSEMBLE)[order]) for test in REGULAR]
    cells = np.concatenate(leads, axis=1)
    both = [cells[..., _columns(result, names)] for names in (LOADS, _motions(result))]
    loads, motions = (_interval(result, REGULAR, _middle, each).text(0, "°") for each in both)
    more = _interval(result, REGULAR, lambda a, b: _middle(a) - _middle(b), *both, signed=True)
    return f"median |phase|: loads {loads}, motions {motions}", opposite(more.below(0.0))


def _stern(results: Results) -> Judged:
    result, line = results["paper"], "mooring_stern"
    errors = [error_of(result, (test,), (line,)) for test in REGULAR]
    slack = [_slack(results["raw"], test, line) for test in REGULAR]
    falls = [
        errors[longer].below_other(errors[shorter])
        for shorter, longer in pairwise(range(len(REGULAR)))
        if slack[longer].upper + SLACKER < slack[shorter].lower
        and np.isfinite([errors[longer].value, errors[shorter].value]).all()
    ]
    listed = ", ".join(e.text() if np.isfinite(e.value) else "only noise" for e in errors)
    parts = ", ".join(each.part() for each in slack)
    return f"NRMSE {listed}; slack {parts} of the time", all_of(falls) if falls else None


def _slack(result: StudyResult, test: str, line: str) -> Interval:
    """Part of the time at which a line is slack in the windows of a test set."""
    data = result.tests[test].sel(channel=line)
    loads = zip(data["measured"].values, data["noise_std"].values, strict=True)
    shares = np.array([[slack_share(load, noise) for load, noise in loads]])
    return _interval(result, (test,), lambda drawn: _flat(drawn).mean(axis=1), shares)


def _variants(result: StudyResult, key: str) -> dict[str, FloatArray]:
    """A number of the models with λ, without, and truncated, over (training, 1)."""
    order, _ = training_order(result.groups["training"])
    data = result.groups[f"regularisation/{SINGLE}"][key].isel(training=order)
    return {str(name): data.sel(variant=name).values[:, None] for name in data["variant"].values}


def _stable(results: Results) -> Judged:
    radii = _variants(results["paper"], "radius")
    ours, none = (_interval(results["paper"], SEA, _middle, radii[k]) for k in ("ridge", "none"))
    words = f"spectral radius {ours.text()} with λ, {none.text()} without"
    return words, all_of([ours.below(1.0), opposite(none.below(1.0))])


def _cheaper(results: Results) -> Judged:
    seconds = _variants(results["paper"], "seconds")
    ratios = seconds["truncated"] / seconds["ridge"]
    times = _interval(results["paper"], SEA, _middle, ratios)
    return f"the SVD takes {times.text(0)} times as long", opposite(times.below(1.0))


def _robust_to_noise(results: Results) -> Judged:
    result = results["paper"]
    order, _ = training_order(result.groups["training"])
    data = result.groups[f"regularisation/{SINGLE}"].isel(training=order)
    truncated = data["truncated_nrmse"].transpose("training", "window", "channel").values
    cells = _cells(result, SEA, model=SINGLE), truncated
    ratio = _interval(result, SEA, lambda a, b: _median(a) / _median(b), *cells)
    rank = int(data["rank"].median())
    return f"ANRMSE {ratio.change()} from {rank} singular values to λ", ratio.below(1.0)


CLAIMS: dict[str, Callable[[Results], Judged]] = {
    "robust": _robust,
    "trend": _trend,
    "any_length": _any_length,
    "who_errs": _who_errs,
    "load_divergence": _load_divergence,
    "densities": _densities,
    "better": partial(_better, statistic=_median),
    "dispersion": partial(_better, statistic=_spread),
    "always_better": _always_better,
    "narrow": _narrow,
    "load_band": _load_band,
    "slow_loads": _slow_loads,
    "peaks": _peaks,
    "stable": _stable,
    "cheaper": _cheaper,
    "robust_to_noise": _robust_to_noise,
    "regular": _regular,
    "against_irregular": _against_irregular,
    "phase": _phase,
    "stern": _stern,
}
"""What judges each claim, in the order of the paper; ``words.toml`` has the words."""


def _changes(ratios: Mapping[str, Interval]) -> str:
    """Text of the changes of both measures."""
    return ", ".join(f"{words} {each.change()}" for words, each in ratios.items())
