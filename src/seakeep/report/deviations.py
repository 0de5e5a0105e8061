"""What the paper leaves open or misprints, and what is in effect in a study."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from seakeep.report.figures.common import model_words
from seakeep.report.study_tables import ReportTable
from seakeep.study import StudyResult
from seakeep.study.plan import windows_overlap

__all__ = [
    "alignment_words",
    "deviations",
    "prior_words",
    "test_overlap",
    "training_overlap",
    "training_windows_overlap",
    "unequal_training",
    "whole_readers",
]

APART = 0.005
"""Windows that share less than this part of their length are apart."""


def training_overlap(result: StudyResult) -> str:
    """Sentence on how far the training windows overlap.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    str
        Empty where windows are not drawn.
    """
    found = _overlap(result)
    if found is None:
        return ""
    count, length, span, share = found
    room = (
        f"A training window must hold the largest draw with its delay history, {length:.1f} T̂ of "
        f"the {span:.0f} T̂ of the longest training span"
    )
    if count == 1:
        return f"{room}; there is one."
    nested = _nested(result)
    whole = (
        f" From the begins of their spans, where {_listed(whole_readers(result))} reads them, they "
        f"share {100 * nested:.0f} %."
        if nested >= APART
        else ""
    )
    if share < APART:
        runs = len(set(result.groups["training"]["run"].values.tolist()))
        where = f", which lie in {runs} runs," if runs > 1 else ""
        return f"{room}; the {count} windows{where} do not overlap.{whole}"
    return (
        f"{room}: so the {count} windows share {100 * share:.0f} % of their length with one "
        f"another.{whole} They are not independent, and the boxes show the spread over test "
        "windows more than that over training data."
    )


def whole_readers(result: StudyResult) -> list[str]:
    """Models that read all of a training set, whatever its length.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    list of str
        Their names.
    """
    return [model for model, length in _stated_lengths(result).items() if length == "None"]


def unequal_training(result: StudyResult) -> str:
    """Sentence on models that learn from different lengths of data.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    str
        Empty where all of them read all, or none does.
    """
    stated, whole = _stated_lengths(result), whole_readers(result)
    others = [model for model in stated if model not in whole]
    if not (whole and others):
        return ""
    period = float(result.attrs["encounter_period"])
    sets = [sum(end - begin for begin, end in each) / period for each in _spans(result)]
    low, high = f"{min(sets):.0f}", f"{max(sets):.0f}"
    told = []
    for model in others:
        if result.is_ensemble(model):
            length = prior_words(stated[model])
        else:
            length = f"{int(stated[model]) * float(result.attrs['dt']) / period:.3g}"
        told.append(f"{model_words(model)} from a part ({length} T̂)")
    return (
        f"Models learn from different amounts of data: {_listed(whole)} from all of a training set "
        f"({low if low == high else f'{low} to {high}'} T̂), {', '.join(told)}. A difference "
        "between them is one of training data too."
    )


def _listed(models: list[str]) -> str:
    return ", ".join(map(model_words, models))


def _stated_lengths(result: StudyResult) -> dict[str, str]:
    """Training length of each model as it was stated; "None" where it reads all."""
    specs: dict[str, dict[str, str]] = json.loads(result.attrs["specs"])
    return {
        m: spec["train_length" if "train_length" in spec else "window"] for m, spec in specs.items()
    }


def _spans(result: StudyResult) -> list[list[tuple[float, float]]]:
    """Begin and end of each span of each training set, s."""
    return [_edges(text) for text in result.groups["training"]["spans"].values]


def _edges(text: object) -> list[tuple[float, float]]:
    """Begin and end of each span that a text tells, s."""
    found = re.findall(r"(-?[\d.e+]+) to (-?[\d.e+]+) s", str(text))
    return [(float(begin), float(end)) for begin, end in found]


def _nested(result: StudyResult) -> float:
    """Part of a training set that others hold too, as models without a window read them."""
    training = result.groups["training"]
    if not whole_readers(result):
        return 0.0
    runs = [str(run) for run in training["run"].values]
    return windows_overlap([(r, *span) for r, (span,) in zip(runs, _spans(result), strict=True)])


def training_windows_overlap(result: StudyResult) -> bool:
    """Whether training windows share a part of their length that counts."""
    found = _overlap(result)
    return found is not None and found[0] > 1 and max(found[3], _nested(result)) >= APART


def test_overlap(result: StudyResult) -> str:
    """Sentence on test windows that overlap.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    str
        Empty where no two do.
    """
    said = []
    for test, data in result.tests.items():
        length = float(data["time"].values[-1])
        pairs = zip(data["run"].values, data["start"].values, strict=True)
        share = windows_overlap([(str(run), float(s), float(s) + length) for run, s in pairs])
        if share >= APART:
            said.append(f"{result.label_of(test)} {100 * share:.0f} %")
    if not said:
        return ""
    return (
        f"Test windows overlap; the mean part of one that others cover too: {', '.join(said)}. "
        "Errors over them are not independent."
    )


def _overlap(result: StudyResult) -> tuple[int, float, float, float] | None:
    """Windows, length of one and of a span in encounter periods, and part shared with others."""
    training = result.groups["training"]
    if result.settings["training"]["scheme"] != "halves" or "stop" not in training:
        return None
    period = float(result.attrs["encounter_period"])
    length = float(result.attrs["longest_training"])
    stops, runs = training["stop"].values, training["run"].values
    spans = [(str(r), float(s) - length, float(s)) for r, s in zip(runs, stops, strict=True)]
    halves = result.groups["runs"]["train_span"].values
    longest = max((end - begin for span in halves for begin, end in _edges(span)), default=np.nan)
    return len(spans), length / period, longest / period, windows_overlap(spans)


def deviations(result: StudyResult) -> ReportTable:
    """What the paper leaves open or misprints, and what is in effect here.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    ReportTable
        The paper has a column where the study asks for it.
    """
    preset = str(result.attrs["preset"])
    rows = [
        ("preset", "none: settings in the text", f"'{preset}', for what the study file leaves out"),
        *_data_rows(result),
        *_model_rows(result),
        *_study_rows(result),
    ]
    note = str(result.attrs.get("preparation_note", ""))
    if not result.shows_paper:
        chosen = tuple((subject, here) for subject, _, here in rows)
        return ReportTable(
            "method", f"Method in effect (preset {preset})", ("subject", "in effect"), chosen, note
        )
    return ReportTable(
        "deviations",
        f"What the paper leaves open, and what is in effect here (preset {preset})",
        ("subject", "the paper", "in effect here"),
        tuple(rows),
        note,
    )


Rows = list[tuple[str, str, str]]


def _data_rows(result: StudyResult) -> Rows:
    stated = result.settings["study"].get("encounter_period")
    preparation = json.loads(result.attrs["preparation"])
    period, dt = float(result.attrs["encounter_period"]), float(result.attrs["dt"])
    filtered = []
    if preparation["low_pass"]:
        edges = " to ".join(f"{edge:g}" for edge in preparation["low_pass"])
        filtered.append(f"low-pass {edges} Hz")
    if preparation["anti_alias"]:
        filtered.append("low-pass below 0.8 of the new Nyquist frequency")
    places = [
        f"{name} at {float(run[name].attrs['x_position']):g} m"
        for run in [next(iter(result.prepared.values()))]
        for name in map(str, run.data_vars)
        if name in result.groups["channels"]["name"].values and "x_position" in run[name].attrs
    ]
    made = str(result.attrs.get("waves_note", ""))
    return [
        ("mean encounter period T̂", "N/T, a frequency; 1.64 s is T/N",
         f"{'stated' if stated else 'T/N'}: {period:.4f} s"),
        ("time step", "32 samples a period", f"{period / dt:.4g} samples a period, {dt:.4g} s"),
        *([("waves", "√(4πE Δf) with E per Hz; 100 components at equal spacing, so that the "
            "envelope returns after 116.5 s", made)] if made else []),
        ("filter before resampling", "10 to 10.75 Hz, above the new Nyquist frequency",
         " and ".join(filtered) or "none"),
        *([("places of the probes", "48.24 m and 48.42 m for the same pole", ", ".join(places))]
          if places else []),
        ("wave spectra", "Welch segments of 8.2 s", "Welch segments of 8.2 s and of 60 s"),
    ]  # fmt: skip


def _model_rows(result: StudyResult) -> Rows:
    specs: dict[str, dict[str, str]] = json.loads(result.attrs["specs"])

    def each(key: str, words: Callable[[str], str] = str) -> str:
        values = {model: words(spec[key]) for model, spec in specs.items() if key in spec}
        if len(set(values.values())) == 1:
            return next(iter(values.values()))
        return "; ".join(f"{model_words(model)}: {value}" for model, value in values.items())

    conditional = str(result.attrs.get("conditional_on", ""))
    return [
        ("alignment of the waves to the vessel", "one effective celerity, measured surge",
         each("alignment", alignment_words)),
        ("measured outputs read after the start", "surge, through the alignment",
         f"{conditional}: every error, band and density here is conditional on measured "
         f"{conditional}" if conditional else "none: forecasts in the strict sense"),
        ("standardisation", "z-score on the training window",
         each("standardize", _standardisation)),
        ("history of the training window", "its sizes hold only before it",
         each("history", _history)),
        ("rows of Â that shift the delays", "ridge on all rows", each("delay_rows", _delay_rows)),
        ("ridge", "λ absolute while m varies",
         f"{each('ridge_scale', _ridge_scale)}; {each('ridge', prior_words)}"),
        ("delays to samples", "nearest integer in the text, floor in the box", "nearest"),
        ("end of a training window", "where it lies is unstated", "its stop, for all draws"),
        ("band", "'95 % confidence interval'", "quantiles of the members, point by point"),
        ("'Bayesian'", "the prior pushed forward",
         "the prior pushed forward: there is no likelihood"),
    ]  # fmt: skip


def _study_rows(result: StudyResult) -> Rows:
    training = result.settings["training"]
    scheme = {
        "halves": "windows in the training spans (halves), tests in the others",
        "pooled": "all training spans pooled, tests in the others",
        "leave_out": f"leave one {training['leave_out'].replace('_', ' ')} out",
    }[training["scheme"]]
    found = _overlap(result)
    overlap: Rows = []
    if found is not None:
        count, length, span, share = found
        shared = ""
        if count > 1:
            shared = "; they do not overlap"
        if training_windows_overlap(result):
            shared = f"; they share {100 * share:.0f} % of their length"
        windows = "1 window" if count == 1 else f"{count} windows"
        overlap = [
            ("training windows", "ten, drawn at random, which cannot but overlap",
             f"{windows}, placed {_placed(training['placement'])}; the largest draw reads "
             f"{length:.1f} T̂ of a span of {span:.0f} T̂{shared}"),
        ]  # fmt: skip
    placements = {each["placement"] for each in result.settings["tests"].values()}
    return [
        ("training and test", "first and second halves", scheme),
        *overlap,
        ("test windows", "drawn at random, so that they overlap",
         ", ".join(sorted(map(_placed, placements)))),
        ("block length", "(2φ/a)^(2/3) T^(1/3), φ with a square missing",
         "paper variant: with the square, capped at a quarter; recommended: Politis–White"),
        ("bandwidth", "1.06 min(SD, IQR) T^(-1/5), IQR lacks /1.34",
         "paper variant: as printed; recommended: Silverman's"),
        ("series for the divergence", "which models' forecasts enter is unstated",
         "each training set's (mean) forecast over its test windows, joined; pooled"),
        ("U of the divergence", "q0.95 − q0.025 in the equation", "q0.975 − q0.025"),
        ("test of ε(t)", "'no trend', so arbitrarily long forecasts",
         "tested as a whole and in two bands; nothing is said beyond the window"),
    ]  # fmt: skip


def _placed(placement: str) -> str:
    return {"random": "at random", "apart": "without overlap"}[placement]


def _standardisation(word: str) -> str:
    return {"True": "z-score on the training window", "False": "none"}.get(word, word)


def _history(word: str) -> str:
    return {"before": "before the window", "inside": "inside the window"}.get(word, word)


def _delay_rows(word: str) -> str:
    return {"ridge": "ridge on all rows", "exact": "exact shifts"}.get(word, word)


def _ridge_scale(word: str) -> str:
    return {"absolute": "λ absolute", "per_snapshot": "λ times the number of columns"}.get(
        word, word
    )


def _keywords(text: str) -> tuple[str, dict[str, Any]] | None:
    """Name and keywords of a printed constructor; None for other text."""
    try:
        call = ast.parse(text, mode="eval").body
    except SyntaxError:
        return None
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        return None
    try:
        found = {str(each.arg): ast.literal_eval(each.value) for each in call.keywords}
    except ValueError:
        return None
    return call.func.id, found


def prior_words(text: str) -> str:
    """Words of a prior, or of a number.

    Examples
    --------
    >>> prior_words("Uniform(low=50, high=150)"), prior_words("100.0")
    ('uniform from 50 to 150', '100')
    >>> prior_words("Fixed(value=80.0)"), prior_words("scipy.stats.norm(loc=100.0, scale=20.0)")
    ('80 in all draws', 'scipy.stats.norm(loc=100.0, scale=20.0)')
    """
    try:
        return f"{float(text):g}"
    except ValueError:
        pass
    found = _keywords(text)
    if found is not None and found[0] == "Fixed":
        return f"{found[1]['value']:g} in all draws"
    kinds = {"Uniform": "uniform", "LogUniform": "log-uniform"}
    if found is None or found[0] not in kinds or not {"low", "high"} <= set(found[1]):
        return text
    return f"{kinds[found[0]]} from {found[1]['low']:.4g} to {found[1]['high']:.4g}"


def alignment_words(text: str) -> str:
    """What an alignment does, in words; what was left out is said as what it stands for.

    Parameters
    ----------
    text : str
        A :class:`~seakeep.ProbeAlignment` as it prints, or ``None``.

    Returns
    -------
    str

    Examples
    --------
    >>> alignment_words("None")
    'none: the waves are taken where the probes stand'
    >>> alignment_words("ProbeAlignment(mode='effective', surge='none', celerity=2.8, offset=0.0)")
    'one celerity, 2.8 m/s as stated, to the place at rest'
    """
    if text == "None":
        return "none: the waves are taken where the probes stand"
    found = _keywords(text)
    if found is None:
        return text
    keys = found[1]
    if keys.get("mode") == "dispersion":
        limit = keys.get("highest_frequency")
        edge = "" if limit is None else f" up to {limit:g} Hz"
        words = f"linear dispersion, frequency by frequency{edge}"
    elif keys.get("celerity") is None:
        words = "one celerity, estimated from the two probes in each training window"
    else:
        words = f"one celerity, {keys['celerity']:g} m/s as stated"
    channel = keys.get("surge_channel", "surge")
    words += {
        "measured": f", to the measured {channel}",
        "predicted": f", to the {channel} that the model itself predicts",
        "none": ", to the place at rest",
    }.get(str(keys.get("surge")), "")
    if keys.get("offset"):
        words += f", and by {keys['offset']:g} m in all runs"
    if keys.get("channels"):
        words += f"; elevations: {', '.join(keys['channels'])}"
    return words
