"""Claims of the paper's results and conclusions, checked against the acts of the reproduction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core.bands import split_bands
from seakeep.report.tables import Table, probability, signed
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

__all__ = ["CLAIMS", "Verdict", "claims_table"]

Results = Mapping[str, StudyResult]
Statistic = Callable[..., FloatArray]

LOADS = ("mooring_bow", "mooring_stern")
REGULAR = ("regular_1_5", "regular_2", "regular_3")
USEFUL = 0.5
"""Median NRMSE below which a forecast counts as accurate: three quarters of the variance."""
SINGLE, ENSEMBLE = "deterministic", "bayesian"
MEASURES = {"nrmse": "ANRMSE", "nammae": "NAMMAE"}


class Interval(NamedTuple):
    """A number with its 95 % interval by two-way bootstrap; NaN where there is none."""

    value: float
    lower: float
    upper: float

    def below(self, bound: float) -> bool | None:
        """Whether it lies below a bound; None where the interval holds the bound."""
        if self.upper < bound:
            return True
        return False if self.lower > bound else None

    def below_other(self, other: Interval) -> bool | None:
        """Whether it lies below another number; None where the intervals meet."""
        if self.upper < other.lower:
            return True
        return False if self.lower > other.upper else None

    def percent(self) -> str:
        """Text of a ratio as a relative change."""
        return self._text(lambda value: f"{signed(100 * (value - 1), 0)} %")

    def part(self) -> str:
        """Text of a share."""
        return self._text(lambda value: f"{100 * value:.0f} %")

    def degrees(self) -> str:
        """Text of an angle."""
        return self._text(lambda value: f"{value:.0f}°")

    def text(self) -> str:
        """Text of an error."""
        return self._text(lambda value: f"{value:.2f}")

    def _text(self, form: Callable[[float], str]) -> str:
        if np.isnan(self.lower):
            return form(self.value)
        low, high = (form(each).rstrip(" %°") for each in (self.lower, self.upper))
        return f"{form(self.value)} [{low}, {high}]"


class Verdict(NamedTuple):
    """What a study shows of a claim.

    Attributes
    ----------
    figure : str
        Our number.
    holds : bool or None
        None where the study cannot tell.
    why : str
        How it was judged, or what of the difference comes from the virtual tank.
    """

    figure: str
    holds: bool | None
    why: str = ""


def claims_table(results: Results) -> Table:
    """Each claim, our figure, and whether it holds, in the first act."""
    words = {True: "holds", False: "does not", None: "cannot tell"}
    rows = []
    for claim, judge in CLAIMS:
        found = judge(results)
        rows.append((claim, found.figure, words[found.holds], found.why))
    return Table(
        "claims",
        "Claims of the paper's results and conclusions",
        (
            "the paper says",
            "here: act (a) unless said",
            "verdict",
            "how judged, what is the tank's",
        ),
        tuple(rows),
        "In brackets 95 % intervals by a two-way block bootstrap over training sets and windows; a "
        "claim whose bound lies inside its interval is one that the study cannot tell. The "
        "Bayesian model where no other is named. The paper's vessel and tank are others: what does "
        "not hold here is not refuted there.",
    )


def all_of(verdicts: list[bool | None]) -> bool | None:
    """Whether all hold: not if one does not, unknown if one is.

    Examples
    --------
    >>> all_of([True, True]), all_of([True, None]), all_of([None, False])
    (True, None, False)
    """
    if False in verdicts:
        return False
    return None if None in verdicts else True


def _cells(result: StudyResult, tests: tuple[str, ...], model: str, measure: str) -> FloatArray:
    """Errors over (training, window, channel), NaN where not judged; windows of all test sets."""
    order, _ = training_order(result.groups["training"])
    parts = [
        data["error"].where(data["judged"]).sel(model=model, measure=measure).values
        for data in (result.tests[test] for test in tests)
    ]
    return np.concatenate(parts, axis=1)[order]


def _interval(
    result: StudyResult, tests: tuple[str, ...], statistic: Statistic, *cells: FloatArray
) -> Interval:
    """A statistic of cells (training, window, …) with its interval."""
    blocks = blocks_of([result.tests[test] for test in tests], result.groups["training"])
    rng = random_stream(int(result.attrs["seed"]), "claims")
    lower, upper = two_way_interval(statistic, *cells, rng=rng, blocks=blocks)
    value = statistic(*(each[None] for each in cells))[0]
    return Interval(float(value), float(lower), float(upper))


def _median(drawn: FloatArray) -> FloatArray:
    """Median over cells (series, training, window, channel) of the average over channels."""
    return median_of(average_of(drawn).reshape(len(drawn), -1))


def _ratio(drawn: FloatArray, other: FloatArray) -> FloatArray:
    return _median(drawn) / _median(other)


def _spread(drawn: FloatArray) -> FloatArray:
    """Inter-quartile range over cells of the average over channels."""
    averages = average_of(drawn).reshape(len(drawn), -1)
    quartiles = np.nanquantile(averages, [0.25, 0.75], axis=1)
    out: FloatArray = quartiles[1] - quartiles[0]
    return out


def _columns(result: StudyResult, channels: tuple[str, ...]) -> list[int]:
    return [result.channels.index(name) for name in channels]


def _motions(result: StudyResult) -> tuple[str, ...]:
    return tuple(name for name in result.channels if name not in LOADS)


def _error(
    result: StudyResult,
    tests: tuple[str, ...],
    channels: tuple[str, ...] = (),
    measure: str = "nrmse",
    model: str = ENSEMBLE,
) -> Interval:
    """Median error of the average over some channels, or over all."""
    cells = _cells(result, tests, model, measure)
    picked = _columns(result, channels) if channels else slice(None)
    return _interval(result, tests, _median, cells[..., picked])


def _robust(results: Results) -> Verdict:
    result = results["paper"]
    own, fir = (_error(result, ("irregular",), model=m) for m in (ENSEMBLE, "fir"))
    worst = float(np.nanmax(average_of(_cells(result, ("irregular",), ENSEMBLE, "nrmse"))))
    return Verdict(
        f"median ANRMSE {own.text()}, worst cell {worst:.2f}; FIR {fir.text()}",
        all_of([own.below(USEFUL), worst < 1.0]),
        f"Median below {USEFUL:g}, no cell above 1. FIR is a linear filter of the waves.",
    )


def _trend(results: Results) -> Verdict:
    at = results["paper"].groups["statistics/trend"]["p_value"].sel(test="irregular", band="all")
    values = [float(at.sel(model=model)) for model in (SINGLE, ENSEMBLE)]
    raw = results["raw"].groups["statistics/trend"]["p_value"].sel(test="irregular", band="all")
    kept = [probability(float(raw.sel(model=model))) for model in (SINGLE, ENSEMBLE)]
    return Verdict(
        f"p = {' and '.join(map(probability, values))}; act (b): {' and '.join(kept)}",
        False if min(values) < 0.05 else None,
        "Mann–Kendall test of ε(t), both models; p below 0.05 is a trend, and above it proves "
        "none.",
    )


def _any_length(results: Results) -> Verdict:
    period = float(results["paper"].attrs["encounter_period"])
    length = float(results["paper"].tests["irregular"]["time"].values[-1])
    return Verdict(
        f"{length / period:.0f} T̂ were forecast, as in the paper",
        None,
        "No longer windows are judged; this tank's drift (18 T̂) is slower than a window.",
    )


def _share(result: StudyResult, measure: str, channels: tuple[str, ...]) -> Interval:
    """Fraction of the average error that some channels make."""
    picked = _columns(result, channels)

    def statistic(drawn: FloatArray) -> FloatArray:
        means = average_of(drawn.reshape(len(drawn), -1, drawn.shape[-1]).swapaxes(1, 2))
        out: FloatArray = means[:, picked].sum(axis=1) / np.nansum(means, axis=1)
        return out

    cells = _cells(result, ("irregular",), ENSEMBLE, measure)
    return _interval(result, ("irregular",), statistic, cells)


def _who_errs(results: Results) -> Verdict:
    shares = {words: _share(results["paper"], key, LOADS) for key, words in MEASURES.items()}
    raw = _share(results["raw"], "nrmse", SLOW)
    below = [each.below(0.5) for each in shares.values()]
    return Verdict(
        f"loads make {', '.join(f'{each.part()} of {words}' for words, each in shares.items())}; "
        f"act (b): surge and loads {raw.part()} of ANRMSE",
        all_of([None if each is None else not each for each in below]),
        "More than half, by 2 of 11 channels.",
    )


def _load_divergence(results: Results) -> Verdict:
    at = results["paper"].groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
    loads, others = (
        at.sel(channel=list(names)).mean("channel") for names in (LOADS, _motions(results["paper"]))
    )
    low, value, high = (
        float(loads[a] / others[b])
        for a, b in (("lower", "upper"), ("mean", "mean"), ("upper", "lower"))
    )
    below = Interval(value, low, high).below(10**0.5)
    return Verdict(
        f"{float(loads['mean']):.4f} against {float(others['mean']):.4f}: a factor of {value:.0f} "
        f"[{low:.1f}, {high:.0f}]",
        None if below is None else not below,
        "Mean JSD of the loads and of the nine others; a factor above √10. The interval joins the "
        "bounds of both, which is wide.",
    )


def _densities(results: Results) -> Verdict:
    result = results["paper"]
    at = result.groups["statistics/divergence"].sel(model=ENSEMBLE, variant="paper")
    at = at.sel(channel=list(_motions(result)))
    within = int((at["mean"] <= at["noise_floor_upper"]).sum())
    return Verdict(
        f"{within} of {at.sizes['channel']} motions within the noise of the record",
        within == at.sizes["channel"],
        "JSD below the upper bound of the measurement's divergence from itself.",
    )


def _against_single(
    result: StudyResult, tests: tuple[str, ...], statistic: Statistic
) -> dict[str, Interval]:
    """A statistic of the ensemble beside the single model, in both measures."""
    return {
        words: _interval(
            result, tests, statistic, *(_cells(result, tests, m, key) for m in (ENSEMBLE, SINGLE))
        )
        for key, words in MEASURES.items()
    }


def _better(results: Results) -> Verdict:
    found = _against_single(results["paper"], ("irregular",), _ratio)
    return Verdict(
        ", ".join(f"{words} {each.percent()}" for words, each in found.items()),
        all_of([each.below(1.0) for each in found.values()]),
        "Change of the median from the deterministic to the Bayesian model.",
    )


def _dispersion(results: Results) -> Verdict:
    def statistic(drawn: FloatArray, other: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):  # a redraw may hold one cell alone
            return _spread(drawn) / _spread(other)

    found = _against_single(results["paper"], ("irregular",), statistic)
    return Verdict(
        ", ".join(f"{words} {each.percent()}" for words, each in found.items()),
        all_of([each.below(1.0) for each in found.values()]),
        "Change of the inter-quartile range.",
    )


def _always_better(results: Results) -> Verdict:
    result = results["paper"]
    verdicts = [
        each.below(1.0)
        for test in result.tests
        for each in _against_single(result, (test,), _ratio).values()
    ]
    better, worse = verdicts.count(True), verdicts.count(False)
    return Verdict(
        f"better in {better}, worse in {worse}, undecided in {verdicts.count(None)} of "
        f"{len(verdicts)}",
        all_of(verdicts),
        "Four seas, two measures.",
    )


def _mean(drawn: FloatArray) -> FloatArray:
    """Mean over cells (series, training, window, channel)."""
    return average_of(drawn.reshape(len(drawn), -1))


def _band(result: StudyResult, channels: tuple[str, ...]) -> tuple[Interval, Interval]:
    """Part of the instants inside the band of irregular waves, and its width in window SDs."""
    test, picked = result.tests["irregular"], _columns(result, channels)
    order, _ = training_order(result.groups["training"])
    lower, upper = (bound[order][..., picked] for bound in band_of(test, ENSEMBLE, None))
    measured = test["measured"].values[..., picked]
    judged = test["judged"].values[order][..., None]
    inside = ((measured >= lower) & (measured <= upper)).mean(axis=2)
    width = (upper - lower).mean(axis=2) / measured.std(axis=1, ddof=1)
    cells = (np.where(judged, each, np.nan) for each in (inside, width))
    found = [_interval(result, ("irregular",), _mean, each) for each in cells]
    return found[0], found[1]


def _narrow(results: Results) -> Verdict:
    result = results["paper"]
    inside, width = _band(result, _motions(result))
    error = _error(result, ("irregular",), _motions(result))
    return Verdict(
        f"motions: {width.text()} SD wide, {inside.part()} of the instants inside 95 %",
        width.below(USEFUL),
        f"Width below {USEFUL:g} SD. The median error is {error.value:.2f} SD: the spread of the "
        "hyperparameters is not the error.",
    )


def _load_band(results: Results) -> Verdict:
    inside, _ = _band(results["paper"], LOADS)
    return Verdict(
        f"{inside.part()} of the instants of the loads inside 95 %",
        inside.below(0.9),
        "Fewer than 90 %.",
    )


def _slow_loads(results: Results) -> Verdict:
    result = results["raw"]
    test = result.tests["irregular"]
    split = float(result.settings["statistics"]["split_period"])
    frequency = 1 / (split * float(result.attrs["encounter_period"]))
    order, _ = training_order(result.groups["training"])
    picked = _columns(result, LOADS)
    measured, forecast = (
        split_bands(values[..., picked], float(result.attrs["dt"]), frequency)[0]
        for values in (test["measured"].values, test["mean"].sel(model=ENSEMBLE).values[order])
    )
    errors = np.sqrt(np.mean((forecast - measured) ** 2, axis=2)) / measured.std(axis=1)
    found = [
        _interval(result, ("irregular",), _median, errors[..., [column]])
        for column in range(len(LOADS))
    ]
    told = zip(LOADS, found, strict=True)
    return Verdict(
        "act (b): " + ", ".join(f"{n.removeprefix('mooring_')} {f.text()}" for n, f in told),
        all_of([each.below(1.0) for each in found]),
        "NRMSE of what is slower than the waves; below 1 it beats the mean. Act (a) has none left. "
        "Drift goes with the square of the waves, which no linear map makes.",
    )


def _peaks(results: Results) -> Verdict:
    loads = _error(results["paper"], ("irregular",), LOADS, "nammae")
    return Verdict(
        f"median NAMMAE of the loads {loads.text()} SD",
        loads.below(1.0),
        "Less than one SD. Slap and slack lines of the tank make peaks that no linear model has.",
    )


def _regular(results: Results) -> Verdict:
    result = results["paper"]
    motions = [_error(result, (test,), _motions(result)) for test in REGULAR]
    loads = [_error(result, (test,), LOADS) for test in REGULAR]
    worse = [a.below_other(b) for a, b in zip(motions, loads, strict=True)]
    return Verdict(
        f"λ/L 1.5, 2, 3: motions {', '.join(f.text() for f in motions)}; loads "
        f"{', '.join(f.text() for f in loads)}",
        all_of([*(each.below(USEFUL) for each in motions), *worse]),
        f"Median NRMSE of the motions below {USEFUL:g}, of the loads larger, in all three.",
    )


def _against_irregular(results: Results) -> Verdict:
    result = results["paper"]
    tests = ("irregular", *REGULAR)
    sizes = [result.tests[test].sizes["window"] for test in tests]
    regular = np.repeat([False, *[True] * len(REGULAR)], sizes)
    labels = np.broadcast_to(regular, (result.groups["training"].sizes["training"], regular.size))

    def statistic(drawn: FloatArray, label: FloatArray) -> FloatArray:
        averages = average_of(drawn).reshape(len(drawn), -1)
        kind = label.reshape(len(drawn), -1) > 0.5
        ours, sea = (median_of(np.where(part, averages, np.nan)) for part in (kind, ~kind))
        return ours / sea

    found = {
        words: _interval(
            result, tests, statistic, _cells(result, tests, ENSEMBLE, key), labels.astype(float)
        )
        for key, words in MEASURES.items()
    }
    above = found["ANRMSE"].below(1.0)
    return Verdict(
        ", ".join(f"{words} {each.percent()}" for words, each in found.items()),
        all_of([None if above is None else not above, found["NAMMAE"].below(1.0)]),
        "Median over all regular windows against that in irregular waves.",
    )


def _phase(results: Results) -> Verdict:
    result = results["paper"]
    order, _ = training_order(result.groups["training"])
    cells = np.concatenate(
        [np.abs(phase_leads(result.groups, test, ENSEMBLE)[order]) for test in REGULAR], axis=1
    )
    loads, motions = (
        cells[..., _columns(result, channels)] for channels in (LOADS, _motions(result))
    )
    found = [_interval(result, REGULAR, _every_median, each) for each in (loads, motions)]
    more = _interval(
        result, REGULAR, lambda a, b: _every_median(a) - _every_median(b), loads, motions
    )
    below = more.below(0.0)
    return Verdict(
        f"median |phase|: loads {found[0].degrees()}, motions {found[1].degrees()}",
        None if below is None else not below,
        "At the wave's frequency, over the three regular runs.",
    )


def _every_median(drawn: FloatArray) -> FloatArray:
    """Median over cells and channels (series, training, window, channel)."""
    return median_of(drawn.reshape(len(drawn), -1))


def _stern(results: Results) -> Verdict:
    result = results["paper"]
    errors = [_error(result, (test,), ("mooring_stern",)) for test in REGULAR]
    slack = results["raw"].groups["runs"]["slack"].sel(name="mooring_stern")
    parts = [f"{100 * float(slack.sel(run=run)):.0f} %" for run in REGULAR]
    judged = [each for each in errors if np.isfinite(each.value)]
    falls = [longer.below_other(shorter) for shorter, longer in pairwise(judged)]
    return Verdict(
        f"NRMSE {', '.join(e.text() if e.value == e.value else 'only noise' for e in errors)}; "
        f"slack {', '.join(parts)} of the time",
        all_of(falls) if falls else None,
        "λ/L 1.5, 2, 3. The tank's drift force and pretension decide how slack the line is.",
    )


CLAIMS: tuple[tuple[str, Callable[[Results], Verdict]], ...] = (
    ("Reliable and robust prediction for unseen irregular waves", _robust),
    ("No trend in ε(t) over 15 T̂", _trend),
    ("The same accuracy for arbitrarily long sequences", _any_length),
    ("The great majority of the errors arises from the mooring forces", _who_errs),
    ("JSD of the loads an order of magnitude above the others", _load_divergence),
    ("Densities of the motions very close, intervals almost always overlapping", _densities),
    ("The Bayesian model lowers both errors in irregular waves", _better),
    ("… and their dispersion", _dispersion),
    ("… consistently, in all conditions", _always_better),
    ("The uncertainty of the Bayesian model is very low", _narrow),
    ("Its interval does not cover the mooring loads", _load_band),
    ("The low-frequency content of the loads is captured", _slow_loads),
    ("Load peaks are fairly estimated", _peaks),
    ("Remarkable accuracy for the motions in regular waves too; loads worst", _regular),
    ("In regular waves ANRMSE slightly higher, NAMMAE lower than in irregular", _against_irregular),
    ("… with a more pronounced phase error of the loads", _phase),
    ("The stern load is better predicted in longer waves (less slack)", _stern),
)
"""Claims in the order of the paper, with what judges each."""
