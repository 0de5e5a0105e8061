"""What a study used: waves, channels, runs and their quality, settings, windows, versions."""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any

import numpy as np

from seakeep.arrays import Json
from seakeep.models.selection import UNHELD
from seakeep.report.figures.histories import spectrum_figure
from seakeep.report.page import Section, drawing, section
from seakeep.report.quality_sheet import clock_rows, other_findings, run_row
from seakeep.report.style import listed, model_words, shown_unit
from seakeep.report.tables import WORDS, Table, entries, number, percent, reach, row, table
from seakeep.study import StudyResult
from seakeep.study.judge import window_spans
from seakeep.study.plan import Span, windows_overlap
from seakeep.waves import phase_speed


def waves(result: StudyResult) -> Section:
    """Return the waves that were tested, where they were measured, and their spectra."""
    figure = None
    if "spectra" in result.groups:
        regular = np.isfinite(result.groups["runs"]["wave_frequency"]).any()
        words = " Vertical lines: the regular waves." * bool(regular)
        figure = drawing("spectrum", spectrum_figure, result, regular=words)
    return section("waves", figure, *wave_tables(result))


def wave_tables(result: StudyResult) -> list[Table]:
    """Waves of each run as they were measured, what they are used for, and where, if known."""
    run, channels = next(iter(result.prepared.values())), result.groups["channels"]
    places = [
        (
            str(name),
            channel.attrs.get("long_name", name),
            number(channel.attrs["x_position"], 2),
            "yes" * (name in channels["name"]),
        )
        for name, channel in run.data_vars.items()
        if "x_position" in channel.attrs
    ]
    positions = table("positions", places, frame=channels.attrs.get("frame", ""))
    if (spectra := result.groups.get("spectra")) is None:
        return [positions]
    rows = []
    for at in entries(result.groups["runs"], "run"):
        frequency, depth = float(at["wave_frequency"]), float(at["water_depth"])
        known = np.isfinite(frequency + depth)
        speed = phase_speed(2 * np.pi * frequency, depth) if known else np.nan
        # A sine has a height of 2√2 standard deviations, a sea one of 4.
        factor = np.sqrt(0.5) if np.isfinite(frequency) else 1.0
        spans = ", ".join(
            f"{use} {float(at[f'{use}_begin']):.0f} to {float(at[f'{use}_end']):.0f} s"
            for use in ("train", "test")
            if np.isfinite(at[f"{use}_begin"])
        )
        facts = {
            "sea_state": at["sea_state"].item() or at["waves"].item(),
            "height": factor * spectra["significant_height"].sel(run=at["run"].item()),
            "length": speed / frequency,
            "speed": speed,
            "used": spans or "test",
        }
        rows.append(at.assign(facts))
    return [table("waves", rows, **spectra.attrs), positions]


def data(result: StudyResult) -> Section:
    """Return channels, and what preparation found in each run."""
    channels = result.groups["channels"]
    signs = channels.assign(units=("name", [*map(shown_unit, channels["units"].values)]))
    runs, clocks = [], []
    for name, run in result.prepared.items():
        _, span, count, kinds = run_row(name, run)
        sea = row(result.groups["runs"].sel(run=name), "sea_state")
        findings = "; ".join(other_findings(run))
        runs.append((name, *sea, str(span), count, kinds.replace("_", " ") or "none", findings))
        clocks += [(name, *each) for each in clock_rows(run)]
    frame = channels.attrs.get("frame", "")
    return section(
        "data",
        table("signs", entries(signs, "name"), frame=frame and f"Frame: {frame}."),
        table("quality_of_runs", runs, name="runs"),
        table("clocks", clocks),
    )


APART = 0.005
"""Windows that share less than this part of their length are apart."""
UNITS = WORDS["units"]
"""Units of settings, by the last part of their key."""


def settings(result: StudyResult) -> Section:
    """Return settings, defaults included, training sets and test windows."""
    note = result.attrs.get("waves_note")
    waves = f"Waves of the virtual tank: {note}." if note else ""
    models = [
        (model_words(m), key.replace("_", " "), setting_text(key, each["value"]), each["source"])
        for m, stated in result.model_settings.items()
        for key, each in stated["settings"].items()
    ]
    statistics = {**result.settings["statistics"], "calibrate": result.is_calibrated}
    every = result.settings | {"statistics": statistics, "models": None}
    stated = [(key, setting_text(key, value)) for key, value in _leaves(every)]
    windows, training = [], result.groups["training"]
    for each, spans in zip(entries(training, "training"), training_spans(result), strict=True):
        words = ", ".join(f"{run}, {begin:.2f} to {end:.2f} s" for run, begin, end in spans)
        name, left_out = row(each, "training", "left_out")
        windows.append(("training", name, words, left_out))
    windows += [
        ("test", result.label_of(test), f"{run}, {begin:.2f} to {end:.2f} s", "")
        for test in result.tests
        for run, begin, end in window_spans(result.tests[test])
    ]
    readers = listed(whole_readers(result))
    whole = f" (all of it: {readers})" if readers else ""
    reads = result.attrs["longest_training"]
    return section(
        "settings",
        table("models", models),
        table("settings", [*_data_settings(result), *stated]),
        table("windows", windows, reads=reads, whole=whole),
        more=(waves, training_overlap(result)[1], test_overlap(result)),
    )


def _leaves(tables: Json, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        elif value not in (None, "", []):
            yield f"{prefix}{key}", value


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


def _prior_text(prior: Json, unit: str) -> str:
    """A prior, or another table, in words; `unit` is that of bare numbers."""
    lengths = {"T": " T̂", "s": " s"}
    for kind in ("uniform", "log_uniform"):
        if kind in prior:
            texts = [str(each).partition(" ") for each in prior[kind]]
            bounds = " to ".join(f"{float(each[0]):.6g}" for each in texts)
            return f"{kind.replace('_', '-')}, {bounds}{lengths.get(texts[0][2], unit)}"
    if "distribution" in prior:
        given = ", ".join(f"{key}={each:.6g}" for key, each in prior["parameters"].items())
        shared = lengths.get(prior.get("unit", ""), unit)
        return f"scipy.stats.{prior['distribution']}({given}){shared}"
    return json.dumps(prior)


def _data_settings(result: StudyResult) -> Iterator[tuple[str, str]]:
    """Period, time step and filters of the data."""
    period, dt = result.encounter_period, result.dt
    preparation, filters = json.loads(result.attrs["preparation"]), []
    origin = "stated" if result.settings["study"].get("encounter_period") else "measured"
    if preparation["low_pass"]:
        edges = " to ".join(f"{edge:g}" for edge in preparation["low_pass"])
        filters.append(f"low-pass {edges} Hz")
    if preparation["anti_alias"]:
        filters.append("low-pass below 0.8 of the new Nyquist frequency")
    yield "mean encounter period T̂", f"{period:.4f} s, {origin}"
    yield "time step", f"{dt:.4g} s, {period / dt:.4g} samples per period"
    yield "filter before resampling", " and ".join(filters) or "none"


def training_spans(result: StudyResult) -> list[list[Span]]:
    """Run, start and end (s) of each span of each training set."""
    training = result.groups["training"]
    runs = training["of_run"].values
    return [
        [(run, b, e) for run, b, e in zip(runs, *edges, strict=True) if np.isfinite(b)]
        for edges in zip(training["begin"].values, training["end"].values, strict=True)
    ]


def _trained_on(result: StudyResult) -> dict[str, Any]:
    """Stated training length of each model that has one; None where it or its centre reads all."""
    return {
        model: None if result.setting(model, "centred") else result.setting(model, "window")
        for model, stated in result.model_settings.items()
        if "window" in stated["settings"]
    }


def whole_readers(result: StudyResult) -> list[str]:
    """Models that read all of a training set, for any length."""
    return [model for model, length in _trained_on(result).items() if length is None]


def unequal_training(result: StudyResult) -> str:
    """Sentence on models that learn from different lengths of data; empty where none do."""
    period, training, words = result.encounter_period, result.groups["training"], {}
    sets = (training["end"] - training["begin"]).sum("of_run")
    for model, length in _trained_on(result).items():
        words[model] = f"from all of a training set ({reach(sets / period)} T̂)"
        if isinstance(length, dict):
            words[model] = f"from a part ({_prior_text(length, ' samples')})"
        elif length is not None:
            words[model] = f"from a part ({length * result.dt / period:.3g} T̂)"
    groups = grouped(words)
    return (
        f"Models learn from different amounts of data: {'; '.join(groups)}. Part of the difference "
        "between them is one of training data."
    ) * (len(groups) > 1)


def unequal_look_ahead(result: StudyResult) -> str:
    """Sentence on models that read the waves ahead by different times; empty where none do."""
    ahead = result.groups["chosen"]["look_ahead"]
    groups = grouped({m: f"{reach(ahead.sel(model=m), 2)} s" for m in result.models})
    return (
        "Models read the waves ahead of the instant that they forecast by different times: "
        f"{'; '.join(groups)}. Part of the difference between them is one of waves that are known."
    ) * (len(groups) > 1)


def not_chosen(result: StudyResult) -> str:
    """Sentence on models whose settings nothing was held out to choose; empty without any."""
    fallen = defaultdict[str, list[str]](list)
    for at in entries(result.groups["chosen"], "model", "training"):
        model, training, said = row(at, "model", "training", "words")
        if UNHELD in said:
            fallen[model].append(training)
    groups = grouped({model: f"in {', '.join(sets)}" for model, sets in fallen.items()})
    where = WORDS["sections"]["chosen"]["title"]
    return (
        "Settings were filled in, and not chosen, where no part of the training data is long "
        f"enough to be held out: {'; '.join(groups)}; see “{where}”."
    ) * bool(groups)


def grouped(words: Mapping[str, str]) -> list[str]:
    """What is said of models, once for those of which the same is said."""
    models = defaultdict[str, list[str]](list)
    for model, said in words.items():
        models[said].append(model)
    return [f"{listed(of)} {said}" for said, of in models.items()]


def training_overlap(result: StudyResult) -> tuple[bool, str]:
    """Whether training windows share a part that counts, and a sentence on it."""
    if result.settings["training"]["scheme"] != "halves":
        return False, ""
    period, length = result.encounter_period, result.attrs["longest_training"]
    spans = [span for (span,) in training_spans(result)]
    runs, readers = result.groups["runs"], whole_readers(result)
    longest = float((runs["train_end"] - runs["train_begin"]).max())
    room = (
        "A training window must hold the largest draw with its delay history, "
        f"{length / period:.1f} T̂ of the {longest / period:.0f} T̂ of the longest training span"
    )
    if len(spans) == 1:
        return False, f"{room}; there is one."
    share = windows_overlap([(run, end - length, end) for run, _, end in spans])
    nested, whole = windows_overlap(spans) if readers else 0.0, ""
    if nested >= APART:
        whole = (
            f" From the start of their spans, as {listed(readers)} reads "
            f"them, they share {percent(nested)} %."
        )
    if share < APART:
        count = len({run for run, _, _ in spans})
        where = f", which lie in {count} runs," if count > 1 else ""
        return bool(whole), f"{room}; the {len(spans)} windows{where} do not overlap.{whole}"
    return True, (
        f"{room}: so the {len(spans)} windows share {percent(share)} % of their length with one "
        f"another.{whole} They are not independent, and the boxes show the spread over test "
        "windows more than that over training data."
    )


def test_overlap(result: StudyResult) -> str:
    """Sentence on test windows that overlap; empty where no two do."""
    shares = {test: windows_overlap(window_spans(result.tests[test])) for test in result.tests}
    said = [
        f"{result.label_of(test)} {percent(share)} %"
        for test, share in shares.items()
        if share >= APART
    ]
    return (
        f"Test windows overlap; the mean share of one that others cover too: {', '.join(said)}. "
        "Errors over them are not independent."
    ) * bool(said)


def finished(result: StudyResult) -> str:
    """Day and time at which the study was finished, as people read them."""
    return f"{datetime.fromisoformat(result.attrs['created']):%Y-%m-%d %H:%M:%S %Z}"


def versions(result: StudyResult) -> Section:
    """Return digest, seed and versions."""
    keys = ("study", "digest", "campaign", "campaign_digest", "preset", "seed")
    rows = [(key.replace("_", " "), str(result.attrs[key])) for key in keys]
    rows.append(("finished", finished(result)))
    rows += [(name, str(each)) for name, each in json.loads(result.attrs["versions"]).items()]
    return section("versions", table("versions", rows))


def chosen(result: StudyResult) -> Section:
    """Return how settings that are not stated were chosen, and look-aheads."""
    rows = []
    for at in entries(result.groups["chosen"].sel(model=result.models), "model", "training"):
        text = at["words"].item()
        if text or at["look_ahead"] > 0:
            words = "; ".join(map(str.strip, (text or "stated").splitlines()))
            rows.append(at.assign(words=words))
    return section("chosen", table("chosen", rows))
