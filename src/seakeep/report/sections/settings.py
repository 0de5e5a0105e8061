"""Settings with where each comes from, how they were chosen, windows and versions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import datetime
from typing import Any

import numpy as np

from seakeep.report.figures.common import model_words
from seakeep.report.section import Section
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult
from seakeep.study.plan import windows_overlap

__all__ = [
    "chosen",
    "finished",
    "settings",
    "test_overlap",
    "training_overlap",
    "unequal_training",
    "versions",
]

APART = 0.005
"""Windows that share less than this part of their length are apart."""


def settings(result: StudyResult) -> Section:
    """Return settings, training sets and test windows."""
    words = (training_overlap(result)[1], test_overlap(result))
    return Section(
        "settings",
        "Settings and windows",
        words=tuple(filter(None, (_waves_made(result), *words))),
        tables=(_model_table(result), _settings_table(result), _windows_table(result)),
    )


def _waves_made(result: StudyResult) -> str:
    made = str(result.attrs.get("waves_note", ""))
    return f"Waves of the virtual tank: {made}." if made else ""


def _model_table(result: StudyResult) -> Table:
    """Each setting of each model, with where it comes from."""
    rows = [
        (
            model_words(model),
            key.replace("_", " "),
            setting_text(key, each["value"]),
            each["source"],
        )
        for model, told in result.model_settings.items()
        for key, each in told["settings"].items()
    ]
    return Table(
        "models",
        "Settings of the models, and where each comes from",
        ("model", "setting", "value", "from"),
        rows,
        "Stated: in the study file. Preset: filled in by the model's preset, or the study's. "
        "Study: the study's seed. Default: none of them says anything.",
        folded=True,
    )


def _settings_table(result: StudyResult) -> Table:
    """Settings of the study, defaults included."""
    told = {k: v for k, v in result.settings.items() if k != "models"}
    told["statistics"] = {**told["statistics"], "calibrate": result.is_calibrated}
    rows = [(key, setting_text(key, value)) for key, value in _leaves("", told)]
    return Table(
        "settings",
        "Settings of the study, defaults included",
        ("setting", "value"),
        (*_of_the_data(result), *rows),
        folded=True,
    )


def _of_the_data(result: StudyResult) -> list[tuple[str, str]]:
    """Period, time step and filters of the prepared runs."""
    period, dt = float(result.attrs["encounter_period"]), float(result.attrs["dt"])
    preparation = json.loads(result.attrs["preparation"])
    stated = result.settings["study"].get("encounter_period")
    filters = []
    if preparation["low_pass"]:
        filters.append(
            f"low-pass {' to '.join(f'{edge:g}' for edge in preparation['low_pass'])} Hz"
        )
    if preparation["anti_alias"]:
        filters.append("low-pass below 0.8 of the new Nyquist frequency")
    return [
        ("mean encounter period T̂", f"{period:.4f} s, {'stated' if stated else 'measured'}"),
        ("time step", f"{dt:.4g} s, {period / dt:.4g} samples per period"),
        ("filter before resampling", " and ".join(filters) or "none"),
    ]


def _leaves(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(f"{prefix}.{key}" if prefix else key, inner)
    elif value not in (None, "", []):
        yield prefix, value


UNITS = {
    **dict.fromkeys(("length", "split_period"), "T̂"),
    **dict.fromkeys(("state_delays", "input_delays", "window", "lead"), "samples"),
    **dict.fromkeys(("startup", "encounter_period"), "s"),
}
"""Units of settings, by the last part of their key."""


def setting_text(key: str, value: Any) -> str:
    """A setting as people read it, with its unit.

    Examples
    --------
    >>> setting_text("state_delays", {"log_uniform": ["0.5 T", "1.5 T"]})
    'log-uniform, 0.5 to 1.5 T̂'
    >>> setting_text("tests.irregular.length", 15.0), setting_text("window", None)
    ('15 T̂', 'all samples')
    """
    name = key.rpartition(".")[2]
    if value is None:
        return "all samples" if name == "window" else "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(setting_text("", each) for each in value)
    unit = f" {UNITS[name]}" if name in UNITS else ""
    if isinstance(value, dict):
        return _prior_text(value, unit)
    return f"{value:.6g}{unit}" if isinstance(value, float) else f"{value}{unit}"


def _prior_text(prior: dict[str, Any], unit: str) -> str:
    """A prior, or another table, in words; `unit` is that of bare numbers."""
    for kind, words in (("uniform", "uniform, "), ("log_uniform", "log-uniform, "), ("fixed", "")):
        if kind in prior:
            bounds = prior[kind] if isinstance(prior[kind], list) else [prior[kind]]
            numbers = [str(each).partition(" ") for each in bounds]
            shared = {"T": " T̂", "s": " s"}.get(numbers[0][2], unit)
            return words + " to ".join(f"{float(each[0]):.6g}" for each in numbers) + shared
    if "distribution" in prior:
        given = ", ".join(f"{key}={each:.6g}" for key, each in prior["parameters"].items())
        shared = {"T": " T̂", "s": " s"}.get(prior.get("unit", ""), unit)
        return f"scipy.stats.{prior['distribution']}({given}){shared}"
    return json.dumps(prior)


def _windows_table(result: StudyResult) -> Table:
    """Training sets and test windows."""
    training = result.groups["training"]
    reads = float(result.attrs["longest_training"])
    every = ", ".join(map(model_words, whole_readers(result)))
    whole = f" (all of it: {every})" if every else ""
    rows = []
    for name, left, spans in zip(
        training["training"].values,
        training["left_out"].values,
        training_spans(result),
        strict=True,
    ):
        words = ", ".join(f"{run}, {begin:.2f} to {end:.2f} s" for run, begin, end in spans)
        rows.append(("training", str(name), words, str(left) or ""))
    for test, data in result.tests.items():
        length = float(data["time"].values[-1])
        rows += [
            ("test", result.label_of(test), f"{run}, {start:.2f} to {start + length:.2f} s", "")
            for run, start in zip(data["run"].values, data["start"].values, strict=True)
        ]
    return Table(
        "windows",
        "Training sets and test windows, the same for all models",
        ("use", "set", "instants", "left out"),
        rows,
        "Of a training set: from the start of its span to its stop. A draw reads the last part, "
        f"{reads:.2f} s at most, delay history included{whole}. The delay history of a forecast is "
        "measured data just before the start; it may reach into a training span.",
        folded=True,
    )


def training_spans(result: StudyResult) -> list[list[tuple[str, float, float]]]:
    """Run, start and end (s) of each span of each training set."""
    training = result.groups["training"]
    runs = [str(run) for run in training["of_run"].values]
    return [
        [(run, b, e) for run, b, e in zip(runs, *edges, strict=True) if np.isfinite(b)]
        for edges in zip(training["begin"].values, training["end"].values, strict=True)
    ]


def _trained_on(result: StudyResult) -> dict[str, Any]:
    """Stated training length of each model that has one; None where it reads all."""
    lengths = {}
    for model, told in result.model_settings.items():
        known = told["settings"]
        if "window" in known:
            lengths[model] = known["window"]["value"]
    return lengths


def whole_readers(result: StudyResult) -> list[str]:
    """Models that read all of a training set, for any length."""
    return [model for model, length in _trained_on(result).items() if length is None]


def unequal_training(result: StudyResult) -> str:
    """Sentence on models that learn from different lengths of data; empty where none do."""
    lengths, whole = _trained_on(result), whole_readers(result)
    parts = {model: length for model, length in lengths.items() if length is not None}
    if not (whole and parts):
        return ""
    period = float(result.attrs["encounter_period"])
    sets = [sum(e - b for _, b, e in spans) / period for spans in training_spans(result)]
    low, high = f"{min(sets):.0f}", f"{max(sets):.0f}"
    told = []
    for model, length in parts.items():
        if isinstance(length, dict):
            words = _prior_text(length, " samples")
        else:
            words = f"{length * float(result.attrs['dt']) / period:.3g} T̂"
        told.append(f"{model_words(model)} from a part ({words})")
    return (
        f"Models learn from different amounts of data: {', '.join(map(model_words, whole))} from "
        f"all of a training set ({low if low == high else f'{low} to {high}'} T̂), "
        f"{', '.join(told)}. Part of the difference between them is one of training data."
    )


def training_overlap(result: StudyResult) -> tuple[bool, str]:
    """Whether training windows share a part that counts, and a sentence on it."""
    training = result.groups["training"]
    if result.settings["training"]["scheme"] != "halves" or "stop" not in training:
        return False, ""
    period = float(result.attrs["encounter_period"])
    length = float(result.attrs["longest_training"])
    spans = [span for (span,) in training_spans(result)]
    runs = result.groups["runs"]
    longest = float(np.nanmax(runs["train_end"].values - runs["train_begin"].values))
    room = (
        "A training window must hold the largest draw with its delay history, "
        f"{length / period:.1f} T̂ of the {longest / period:.0f} T̂ of the longest training span"
    )
    if len(spans) == 1:
        return False, f"{room}; there is one."
    share = windows_overlap([(run, end - length, end) for run, _, end in spans])
    nested = windows_overlap(spans) if whole_readers(result) else 0.0
    readers = ", ".join(map(model_words, whole_readers(result)))
    whole = f" From the start of their spans, as {readers} reads them, they share "
    whole = f"{whole}{100 * nested:.0f} %." if nested >= APART else ""
    if share < APART:
        count = len({run for run, _, _ in spans})
        where = f", which lie in {count} runs," if count > 1 else ""
        return bool(whole), f"{room}; the {len(spans)} windows{where} do not overlap.{whole}"
    return True, (
        f"{room}: so the {len(spans)} windows share {100 * share:.0f} % of their length with one "
        f"another.{whole} They are not independent, and the boxes show the spread over test "
        "windows more than that over training data."
    )


def test_overlap(result: StudyResult) -> str:
    """Sentence on test windows that overlap; empty where no two do."""
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
        f"Test windows overlap; the mean share of one that others cover too: {', '.join(said)}. "
        "Errors over them are not independent."
    )


def finished(result: StudyResult) -> str:
    """Day and time at which the study was finished, as people read them."""
    return f"{datetime.fromisoformat(str(result.attrs['created'])):%Y-%m-%d %H:%M:%S %Z}"


def versions(result: StudyResult) -> Section:
    """Return digest, seed and versions."""
    told = [
        ("study", "study"), ("digest", "digest"), ("campaign", "campaign"),
        ("campaign digest", "campaign_digest"), ("preset", "preset"), ("seed", "seed"),
    ]  # fmt: skip
    rows = [(words, str(result.attrs[key])) for words, key in told]
    rows.append(("finished", finished(result)))
    rows += [(name, str(each)) for name, each in json.loads(result.attrs["versions"]).items()]
    table = Table("versions", "Versions and digest", ("what", "value"), rows)
    return Section("versions", "Versions and digest", tables=(table,))


def chosen(result: StudyResult) -> Section | None:
    """Return how settings were chosen; None where all are stated and no model looks ahead."""
    rows = []
    for model in result.models:
        data = result.groups["chosen"].sel(model=model)
        for name, text, ahead in zip(
            data["training"].values, data["words"].values, data["look_ahead"].values, strict=True
        ):
            if text or ahead > 0:
                note, *tried = str(text).splitlines() or ["stated"]
                words = "; ".join([note, *map(str.strip, tried)])
                rows.append((model_words(model), str(name), number(ahead, 2), words))
    if not rows:
        return None
    words = (
        "Settings that are not stated are chosen by free runs on training runs that are held out "
        "in turn; test windows are never looked at. Mean error with its 95 % interval and the best "
        "λ of each choice: what an observable is worth is the error of the choice without it. The "
        "look-ahead is how long after the instant that is forecast the last wave that is read lies."
    )
    table = Table(
        "chosen",
        "Choices and look-ahead",
        ("model", "training set", "look-ahead [s]", "chosen"),
        rows,
        numeric=(2,),
    )
    return Section("chosen", "How settings were chosen", words=(words,), tables=(table,))
