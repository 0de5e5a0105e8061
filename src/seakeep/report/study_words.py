"""What a report says in words: findings, data quality, settings, provenance."""

from __future__ import annotations

import json
import re
from datetime import datetime
from typing import Any

import numpy as np

from seakeep.quality import findings_of
from seakeep.report.deviations import unequal_training, whole_readers
from seakeep.report.figures.common import HEADING, model_words
from seakeep.report.quality_sheet import channel_rows
from seakeep.report.study_tables import ReportTable
from seakeep.report.style import shown_unit
from seakeep.study import StudyResult

__all__ = [
    "findings",
    "finished",
    "quality_table",
    "run_table",
    "settings_table",
    "sign_table",
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
    if unequal := unequal_training(result):
        said.append(unequal)
    for model in ensembles:
        said += _coverage_findings(result, model)
    return said + _windows_found(result)


def _windows_found(result: StudyResult) -> list[str]:
    """Say of which windows, placed without overlap, fewer fit than were asked for."""
    settings = result.settings
    places = {
        f"test windows of {result.label_of(name)}": (settings["tests"][name], data.sizes["window"])
        for name, data in result.tests.items()
    }
    if settings["training"]["scheme"] == "halves":
        used = result.groups["training"].sizes["training"]
        places = {"training windows": (settings["training"], used), **places}
    return [
        f"{used} {what} were used of the {each['windows']} asked for: no more fit without overlap."
        for what, (each, used) in places.items()
        if each["windows"] is not None and used < each["windows"]
    ]


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _verdict(single: float, ensemble: float) -> str:
    if not np.isfinite(single + ensemble):
        return ""
    if ensemble < single:
        return f" (the ensemble's mean is better by {_percent(1 - ensemble / single)})"
    return (
        " (the ensemble does not beat the deterministic model: it is worse by "
        f"{_percent(ensemble / single - 1)})"
    )


def _percent(part: float) -> str:
    return "less than 1 %" if part < 0.005 else f"{100 * part:.0f} %"


def _coverage_findings(result: StudyResult, model: str) -> list[str]:
    first = next(iter(result.tests))
    level = float(result.settings["statistics"]["level"])
    table = result.groups[f"statistics/coverage/{first}"].sel(model=model, against="measured")
    inside = float(table["inside"].sel(channel="average"))
    words = "which is what it claims"
    if abs(inside - level) > 0.05:
        words = "far too little" if inside < level - 0.2 else "not what it claims"
    calibrated = ""
    if "calibrated_inside" in table and np.isfinite(table["calibrated_inside"][0]):
        row = table.sel(channel="average")
        calibrated = (
            f" Calibrated on training data it holds {100 * float(row['calibrated_inside']):.0f} %, "
            f"{float(row['calibrated_relative_width']):.2g} measured SD wide instead of "
            f"{float(row['relative_width']):.2g}."
        )
    lost = int(sum((test[f"{model}_lost"] >= 0).sum() for test in result.tests.values()))
    total = int(sum((test[f"{model}_lost"] >= -1).sum() for test in result.tests.values()))
    return [
        f"The {100 * level:g} % band of the {model_words(model)} model holds "
        f"{100 * inside:.0f} % of the measured instants of {result.label_of(first)}, {words}: "
        "it carries the spread of the hyperparameters, and no noise or model error." + calibrated,
        f"{lost} of {total} member forecasts diverged and were left out of mean and band.",
    ]


def settings_table(result: StudyResult) -> ReportTable:
    """Settings of the study and of each model."""
    rows: list[tuple[str, str]] = []

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{prefix}.{key}" if prefix else key, inner)
        elif value not in (None, "", []):
            shown = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
            rows.append((prefix, _setting_words(prefix, shown)))

    settings = {k: v for k, v in result.settings.items() if k != "models"}
    settings["statistics"] = {**settings["statistics"], "calibrate": result.is_calibrated}
    walk("", settings)
    for model, spec in json.loads(result.attrs["specs"]).items():
        rows += [(f"models.{model}.{key}", _setting_words(key, v)) for key, v in spec.items()]
    return ReportTable("settings", "Settings, defaults included", ("setting", "value"), tuple(rows))


_UNIT_OF_SETTING = {
    **dict.fromkeys(("length", "split_period"), "T̂"),
    **dict.fromkeys(("train_length", "state_delay", "input_delay"), "T̂"),
    **dict.fromkeys(("state_delays", "input_delays", "window"), "samples"),
    **dict.fromkeys(("startup", "encounter_period"), "s"),
}
_PRIOR = re.compile(r"(Uniform|LogUniform|Fixed)\((?:low|value)=([^,)]*)(?:, high=([^)]*))?\)")


def _setting_words(key: str, value: str) -> str:
    """A setting as people read it, with its unit.

    Examples
    --------
    >>> _setting_words("state_delay", "LogUniform(low=0.5, high=1.5)")
    'log-uniform, 0.5 to 1.5 T̂'
    >>> _setting_words("tests.irregular.length", "15.0"), _setting_words("rank", "None")
    ('15 T̂', 'none')
    """
    name = key.rpartition(".")[2]
    if value == "None":
        return "all samples" if name in ("window", "train_length") else "none"
    if value.startswith("ProbeAlignment("):
        stated = dict(re.findall(r"(\w+)='?([^',)]*)'?", value.partition("(")[2]))
        speed = {"None": "celerity estimated"}.get(
            stated.get("celerity", ""), f"celerity {stated.get('celerity')} m/s"
        )
        how = speed if stated.get("mode") == "effective" else "by linear dispersion"
        return f"elevation carried to the vessel, {how}; surge {stated.get('surge')}"
    if value in ("True", "False"):
        return "yes" if value == "True" else "no"
    unit = f" {_UNIT_OF_SETTING[name]}" if name in _UNIT_OF_SETTING else ""
    if prior := _PRIOR.fullmatch(value):
        kind, low, high = prior.groups()
        words = {"Uniform": "uniform, ", "LogUniform": "log-uniform, ", "Fixed": ""}[kind]
        return f"{words}{_plain(low)}{f' to {_plain(high)}' if high else ''}{unit}"
    return _plain(value) + unit if _plain(value) != value or value.isdigit() else value


def _plain(value: str) -> str:
    """A number without digits that nobody reads."""
    return f"{float(value):.6g}" if re.fullmatch(r"-?\d+\.\d+(e[-+]?\d+)?", value) else value


def sign_table(result: StudyResult) -> ReportTable:
    """Channels with units, what is positive, and where they come from."""
    channels = result.groups["channels"]
    rows = [
        (
            result.words_of(str(name)),
            str(at["use"].values),
            shown_unit(str(at["units"].values)),
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


def run_table(result: StudyResult) -> ReportTable:
    """What preparation found in each run: part used, number of findings."""
    runs, rows = result.groups["runs"], []
    for name, run in result.prepared.items():
        found = findings_of(run)
        others = [
            f"{each.channel}: {each.text}" for each in found if each.channel not in run.data_vars
        ]
        words = dict.fromkeys(
            f"{each.channel.replace('_', ' ')} ({each.kind.word})" for each in found
        )
        rows.append(
            (
                name,
                str(runs["sea_state"].sel(run=name).values),
                f"{float(run['time'][0]):.2f} to {float(run['time'][-1]):.2f} s",
                str(len(found)),
                ", ".join(words) or "none",
                "; ".join(others),
            )
        )
    return ReportTable(
        "runs",
        "Data quality of the runs, as preparation found it",
        ("run", "sea state", "part used", "findings", "channel (kind)", "findings of loggers"),
        tuple(rows),
        "Checks flag and tell; nothing is repaired unless the campaign asks for it, and what was "
        "repaired is in the tables below. A finding concerns the whole record, the part that is "
        "cut off too.",
        (3,),
    )


def clock_table(result: StudyResult) -> ReportTable | None:
    """Clocks of the loggers against the reference, a row a run and logger; None for one logger."""
    rows = []
    for name, run in result.prepared.items():
        for key, value in run.attrs.items():
            if not key.startswith("clock_") or not isinstance(value, str):
                continue
            numbers, _, origin = value.partition(" (")
            offset, _, drift = numbers.partition(", ")
            cells = (offset, drift, origin.removesuffix(")"))
            rows.append((name, key.removeprefix("clock_"), *cells))
    if not rows:
        return None
    return ReportTable(
        "clocks",
        "Clocks of the loggers against the reference",
        ("run", "logger", "offset", "drift", "from"),
        tuple(rows),
        "Offset: what the logger's clock reads when the reference reads zero. n: pulses, windows "
        "or samples that it rests on. ±: one standard error.",
        folded=True,
    )


def quality_table(result: StudyResult, name: str) -> ReportTable:
    """Data quality of a run, channel by channel.

    Parameters
    ----------
    result : StudyResult
        The study.
    name : str
        The run.

    Returns
    -------
    ReportTable
        All channels of the prepared run, those that the study does not use too.
    """
    runs, used = result.groups["runs"], set(result.groups["runs"]["name"].values)
    rows = []
    for each in channel_rows(result.prepared[name]):
        channel = each["channel"]
        frozen = slack = ""
        if channel in used:
            at = runs.sel(run=name, name=channel)
            frozen = f"{100 * float(at['constant']):.2f}"
            part = float(at["slack"])
            slack = f"{100 * part:.1f}" if np.isfinite(part) else ""
        words = [finding.text for finding in each["findings"]]
        if each["repaired"]:
            words.append(f"repaired: {each['repaired']}")
        low, high, mean, spread = (f"{value:.4g}" for value in each["numbers"])
        rows.append(
            (
                each["words"],
                "yes" if channel in used else "",
                shown_unit(each["units"]),
                mean,
                spread,
                low,
                high,
                frozen,
                slack,
                each["flagged"],
                "; ".join(words),
            )
        )
    return ReportTable(
        f"quality_{name}",
        f"Data quality of {name}, channel by channel (SI units)",
        ("channel", "used", "unit", "mean", "SD", "min", "max", "frozen %", "slack %", "flagged",
         "found, and done about it"),
        tuple(rows),
        "After preparation; no value that the study uses is missing, or it would have refused the "
        "run. Frozen: samples equal to both neighbours. Slack: a load below 0.1 % of its largest. "
        "Flagged: part of the samples.",
        (3, 4, 5, 6, 7, 8),
        folded=True,
    )  # fmt: skip


def training_table(result: StudyResult) -> ReportTable:
    """Training sets and test windows."""
    training = result.groups["training"]
    reads = float(result.attrs["longest_training"])
    every = ", ".join(map(model_words, whole_readers(result)))
    whole = f" (all of it: {every})" if every else ""
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
        "Of a training set: from the begin of its span to its stop, of which a draw reads the last "
        f"part, {reads:.2f} s at most, delay history included{whole}. The delay history of a "
        "forecast is measured data just before the start; it may reach into a training span.",
    )


def finished(result: StudyResult) -> str:
    """Day and time at which the study was finished, as people read them."""
    return f"{datetime.fromisoformat(str(result.attrs['created'])):%Y-%m-%d %H:%M:%S %Z}"


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
        ("finished", finished(result)),
        *((name, str(version)) for name, version in versions.items()),
    ]
    return ReportTable("versions", "Versions and digest", ("what", "value"), tuple(rows))
