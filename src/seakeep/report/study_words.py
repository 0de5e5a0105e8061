"""What a report says in words: findings, deviations from the paper, settings, provenance."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from seakeep.report.figures.common import HEADING, model_words
from seakeep.report.study_tables import ReportTable, channel_words
from seakeep.study import StudyResult
from seakeep.study.windows import windows_overlap

__all__ = [
    "deviations",
    "findings",
    "quality_table",
    "settings_table",
    "sign_table",
    "training_overlap",
    "training_table",
    "versions_table",
]


def findings(result: StudyResult) -> list[str]:
    """What came out, sentence by sentence, whichever way it came out.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    list of str
    """
    said = []
    singles = [m for m in result.models if not result.is_ensemble(m)]
    ensembles = [m for m in result.models if result.is_ensemble(m)]
    for test in result.tests:
        boxes = result.groups[f"statistics/boxes/{test}"].sel(channel="average")
        parts = []
        for measure, heading in HEADING.items():
            medians = {
                m: float(boxes["median"].sel(model=m, measure=measure)) for m in result.models
            }
            listed = ", ".join(f"{model_words(m)} {v:.3f}" for m, v in medians.items())
            parts.append(f"median {heading} {listed}")
            if singles and ensembles:
                parts[-1] += _verdict(medians[singles[0]], medians[ensembles[0]])
        said.append(f"{_capital(result.label_of(test))}: " + "; ".join(parts) + ".")
    for model in ensembles:
        said += _coverage_findings(result, model)
    return said


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _verdict(single: float, ensemble: float) -> str:
    if not np.isfinite(single + ensemble):
        return ""
    if ensemble < single:
        return f" (the ensemble's mean is better by {100 * (1 - ensemble / single):.0f} %)"
    return (
        " (the ensemble does not beat the deterministic model: it is worse by "
        f"{100 * (ensemble / single - 1):.0f} %)"
    )


def _coverage_findings(result: StudyResult, model: str) -> list[str]:
    first = next(iter(result.tests))
    level = float(result.settings["statistics"]["level"])
    table = result.groups[f"statistics/coverage/{first}"].sel(model=model, against="measured")
    inside = float(table["inside"].sel(channel="average"))
    words = "which is what it claims"
    if abs(inside - level) > 0.05:
        words = "far too little" if inside < level - 0.2 else "not what it claims"
    lost = int(sum((test[f"{model}_lost"] >= 0).sum() for test in result.tests.values()))
    total = int(sum((test[f"{model}_lost"] >= -1).sum() for test in result.tests.values()))
    return [
        f"The {100 * level:g} % band of the {model_words(model)} model holds "
        f"{100 * inside:.0f} % of the measured instants of {result.label_of(first)}, {words}: "
        "it carries the spread of the hyperparameters, and no noise or model error.",
        f"{lost} of {total} member forecasts diverged and were left out of mean and band.",
    ]


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
    training = result.groups["training"]
    if result.settings["training"]["scheme"] != "halves" or "stop" not in training:
        return ""
    period = float(result.attrs["encounter_period"])
    length = float(result.attrs["longest_training"])
    stops, runs = training["stop"].values, training["run"].values
    spans = [(str(r), float(s) - length, float(s)) for r, s in zip(runs, stops, strict=True)]
    share = windows_overlap(spans)
    halves = result.groups["runs"]["train_span"].values
    longest = max((_seconds(str(span)) for span in halves if span), default=np.nan)
    return (
        f"A training window must hold the largest draw with its delay history, "
        f"{length / period:.1f} T̂ of the {longest / period:.0f} T̂ of a training span: so the "
        f"{len(spans)} windows share {100 * share:.0f} % of their length with one another. They "
        "are not independent, and the boxes show the spread over test windows more than that over "
        "training data."
    )


def _seconds(span: str) -> float:
    begin, _, end = span.removesuffix(" s").partition(" to ")
    return float(end) - float(begin)


def deviations(result: StudyResult) -> ReportTable:
    """What the paper leaves open or misprints, and what is in effect here.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    ReportTable
    """
    specs: dict[str, dict[str, str]] = json.loads(result.attrs["specs"])

    def each(key: str) -> str:
        values = {model: spec.get(key, "") for model, spec in specs.items()}
        if len(set(values.values())) == 1:
            return next(iter(values.values()))
        return "; ".join(f"{model_words(model)}: {value}" for model, value in values.items())

    training = result.settings["training"]
    scheme = {
        "halves": "windows in the training spans (halves), tests in the others",
        "pooled": "all training spans pooled, tests in the others",
        "leave_out": f"leave one {training['leave_out'].replace('_', ' ')} out",
    }[training["scheme"]]
    conditional = str(result.attrs.get("conditional_on", ""))
    rows = [
        ("mean encounter period T̂", "N/T, a frequency; 1.64 s is T/N",
         f"{'stated' if result.settings['study'].get('encounter_period') else 'T/N'}: "
         f"{float(result.attrs['encounter_period']):.4f} s"),
        ("alignment of the waves to the vessel", "one effective celerity, measured surge",
         _alignment_words(each("alignment"))),
        ("measured outputs read after the start", "surge, through the alignment",
         conditional or "none"),
        ("history of the training window", "its sizes hold only before it", each("history")),
        ("rows of Â that shift the delays", "ridge on all rows", each("delay_rows")),
        ("ridge", "λ absolute while m varies", f"{each('ridge_scale')}: {each('ridge')}"),
        ("delays to samples", "nearest integer in the text, floor in the box", "nearest"),
        ("training window", "where it lies is unstated", "ends at the window's stop"),
        ("training and test", "first and second halves", scheme),
        ("band", "'95 % confidence interval'", "quantiles of the members, point by point"),
        ("block length", "(2φ/a)^(2/3) T^(1/3), φ with a square missing",
         "paper variant: with the square, capped at a quarter; recommended: Politis–White"),
        ("bandwidth", "1.06 min(SD, IQR) T^(-1/5), IQR lacks /1.34",
         "paper variant: as printed; recommended: Silverman's"),
        ("series for the divergence", "which models' forecasts enter is unstated",
         "each training set's (mean) forecast over its test windows, joined; pooled"),
        ("U of the divergence", "q0.95 − q0.025 in the equation", "q0.975 − q0.025"),
        ("test of ε(t)", "'no trend', so arbitrarily long forecasts",
         "tested; nothing is said beyond the window"),
        ("'Bayesian'", "the prior pushed forward", "the same: there is no likelihood"),
    ]  # fmt: skip
    return ReportTable(
        "deviations",
        f"What the paper leaves open, and what is in effect here (preset {result.attrs['preset']})",
        ("subject", "the paper", "in effect here"),
        tuple(rows),
        str(result.attrs.get("preparation_note", "")),
    )


def _alignment_words(text: str) -> str:
    """An alignment without the keys that were left out."""
    if text == "None":
        return "none: the waves are taken where the probes stand"
    return re.sub(r", \w+=None|\w+=None, ", "", text)


def settings_table(result: StudyResult) -> ReportTable:
    """Settings of the study and of each model."""
    rows: list[tuple[str, str]] = []

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{prefix}.{key}" if prefix else key, inner)
        elif value not in (None, "", []):
            shown = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
            rows.append((prefix, shown))

    settings = {k: v for k, v in result.settings.items() if k != "models"}
    walk("", settings)
    for model, spec in json.loads(result.attrs["specs"]).items():
        rows += [(f"models.{model}.{key}", value) for key, value in spec.items()]
    return ReportTable("settings", "Settings, defaults included", ("setting", "value"), tuple(rows))


def sign_table(result: StudyResult) -> ReportTable:
    """Channels with units, what is positive, and where they come from."""
    channels = result.groups["channels"]
    rows = [
        (
            channel_words(str(name)),
            str(at["use"].values),
            str(at["units"].values),
            str(at["positive"].values),
            str(at["source"].values),
        )
        for name in channels["name"].values
        for at in [channels.sel(name=name)]
    ]
    frame = str(channels.attrs.get("frame", ""))
    return ReportTable(
        "signs",
        "Channels and signs",
        ("channel", "use", "unit", "positive", "source"),
        tuple(rows),
        f"Frame: {frame}." if frame else "",
    )


def quality_table(result: StudyResult) -> ReportTable:
    """Data quality of each run and channel."""
    runs = result.groups["runs"]
    rows = []
    for run in runs["run"].values:
        for name in runs["name"].values:
            at = runs.sel(run=run, name=name)
            slack = float(at["slack"])
            rows.append(
                (
                    str(run),
                    channel_words(str(name)),
                    *(f"{float(at[key]):.4g}" for key in ("mean", "sd", "min", "max")),
                    f"{100 * float(at['constant']):.2f}",
                    f"{100 * slack:.1f}" if np.isfinite(slack) else "",
                )
            )
    return ReportTable(
        "quality",
        "Prepared runs, channel by channel (SI units)",
        ("run", "channel", "mean", "SD", "min", "max", "frozen %", "slack %"),
        tuple(rows),
        "After preparation; no value is missing, or the study would have refused the run. Frozen: "
        "samples equal to both neighbours. Slack: a load below 0.1 % of its largest.",
        (2, 3, 4, 5, 6, 7),
    )


def training_table(result: StudyResult) -> ReportTable:
    """Training sets and test windows."""
    training = result.groups["training"]
    rows = [
        ("training", str(n), str(s), str(left) or "")
        for n, s, left in zip(
            training["training"].values,
            training["spans"].values,
            training["left_out"].values,
            strict=True,
        )
    ]
    for test, data in result.tests.items():
        length = float(data["time"].values[-1])
        rows += [
            ("test", result.label_of(test), f"{run}, {start:.2f} to {start + length:.2f} s", "")
            for run, start in zip(data["run"].values, data["start"].values, strict=True)
        ]
    return ReportTable(
        "windows",
        "Training sets and test windows, the same for all models",
        ("use", "set", "instants", "left out"),
        tuple(rows),
        "The delay history of a forecast is measured data just before the start; it may reach into "
        "a training span.",
    )


def versions_table(result: StudyResult) -> ReportTable:
    """Digest, seed, versions."""
    versions = json.loads(result.attrs["versions"])
    rows = [
        ("study", str(result.attrs["study"])),
        ("digest", str(result.attrs["digest"])),
        ("campaign", str(result.attrs["campaign"])),
        ("campaign digest", str(result.attrs["campaign_digest"])),
        ("preset", str(result.attrs["preset"])),
        ("seed", str(result.attrs["seed"])),
        ("finished", str(result.attrs["created"])),
        *((name, str(version)) for name, version in versions.items()),
    ]
    return ReportTable("versions", "Versions and digest", ("what", "value"), tuple(rows))
