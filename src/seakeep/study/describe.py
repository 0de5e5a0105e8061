"""Data of a study: channels with their signs, runs with their quality, spectra."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from seakeep.campaign import Campaign
from seakeep.conventions import canonical_channel, is_elevation
from seakeep.core.metrics import slack_share
from seakeep.errors import RequestError
from seakeep.signals import significant_height, wave_spectrum
from seakeep.signals.waves import paper_welch
from seakeep.study.fit import find_repeat
from seakeep.study.judge import wave_frequency
from seakeep.study.plan import Plan, between, training_samples, whole_span
from seakeep.study.settings import Study

Runs = Mapping[str, xr.Dataset]

POSITIVE = {
    "surge": "along the waves, from the place at rest",
    "sway": "to port, right-handed with x and z",
    "heave": "upwards",
    "roll": "right-handed about x",
    "pitch": "bow up (the bow points against the waves)",
    "yaw": "right-handed about z",
}
WELCH = ("paper", "recommended")
WORDS = ("sea_state", "waves", "role", "file_sha256")


def describe_study(study: Study, plan: Plan, runs: Runs) -> dict[str, xr.Dataset]:
    """Data that a study used."""
    groups = {
        "channels": _channels(study.campaign, plan, runs),
        "training": _training(plan, runs),
        "runs": _runs(plan, runs),
        **{f"prepared/{name}": _prepared(run) for name, run in runs.items()},
        "repeats": _repeats(study.campaign, plan, runs),
        "spectra": _spectra(plan, runs),
    }
    return {name: group for name, group in groups.items() if group is not None}


def _repeats(campaign: Campaign, plan: Plan, runs: Runs) -> xr.Dataset | None:
    """Runs whose test windows repeat input of their training set; None if there are none."""
    regular = {name for name, run in campaign.settings.runs.items() if run.waves == "regular"}
    spans: dict[str, list[float]] = {}
    for window in (each for windows in plan.tests.values() for each in windows):
        if window.run not in regular:
            end = window.start + window.steps * plan.dt
            spans.setdefault(window.run, []).extend((window.start, end))
    found = []
    for name, edges in spans.items():
        learnt: dict[str, list[float]] = {}
        for each in plan.training:
            for run, *span in each.spans if each.may_test(name) else ():
                if run not in regular:
                    learnt.setdefault(run, []).extend(span)
        pieces = {run: between(runs[run], (min(e), max(e))) for run, e in learnt.items()}
        test = between(runs[name], (min(edges), max(edges)))
        if (repeat := find_repeat(plan.inputs, pieces, name, test, plan.dt)) is not None:
            found.append(asdict(repeat) | {"words": str(repeat)})
    if not found:
        return None
    columns = {key: [each[key] for each in found] for key in found[0] if key != "run"}
    return xr.Dataset(
        {key: ("run", np.array(values)) for key, values in columns.items()},
        coords={"run": [each["run"] for each in found]},
    )


def words_of_repeats(repeats: xr.Dataset) -> str:
    """Say which test runs repeat training input, the one that repeats most in full."""
    worst = repeats.isel(run=int(np.argmax(repeats["share"].values)))
    others = [str(run) for run in repeats["run"].values if run != worst["run"]]
    more = f" So does that of {', '.join(others)}." if others else ""
    words = str(worst["words"].values)
    return f"{words[:1].upper()}{words[1:]}{more} Tests there show memory, not skill."


def _channels(campaign: Campaign, plan: Plan, runs: Runs) -> xr.Dataset:
    first = next(iter(runs.values()))
    names = [*plan.states, *plan.inputs]
    rows = [
        {
            "units": str(first[name].attrs.get("units", "")),
            "long_name": str(first[name].attrs.get("long_name", name)),
            "symbol": canonical.symbol if (canonical := canonical_channel(name)) else "",
            "source": _source(campaign, name),
            "positive": _positive(name),
            "use": "state" if name in plan.states else "input",
        }
        for name in names
    ]
    return xr.Dataset(
        {key: ("name", np.array([row[key] for row in rows], dtype=object)) for key in rows[0]}
        | {"channel": ("channel", np.array(plan.states, dtype=object))},
        coords={"name": names},
        attrs={"frame": campaign.settings.rig.frame or ""},
    )


def _source(campaign: Campaign, name: str) -> str:
    """Where a channel comes from, with its sign and offset."""
    settings = campaign.settings
    if name in settings.channels:
        each = settings.channels[name]
        sign = "−" if each.sign < 0 else ""
        offset = f" + {each.offset:g}" if each.offset else ""
        known = each.unit is None or (each.column or "").endswith(f"[{each.unit}]")
        unit = "" if known else f" [{each.unit}]"
        return f"{sign}column {each.column or name}{unit}{offset}"
    made = settings.derived.get(name)
    if made is None:
        return ""
    if made.expression is not None:
        return made.expression
    words = {"integrate": "integral", "differentiate": "derivative"}
    return f"{words.get(str(made.step), str(made.step))} of {made.source}".replace("_", " ")


def _positive(name: str) -> str:
    for motion, words in POSITIVE.items():
        if name == motion or name.startswith(motion + "_"):
            return words
    if is_elevation(name, rates=True):
        return "above still water"
    return "tension" if name.startswith("mooring_") else "as measured"


def _prepared(run: xr.Dataset) -> xr.Dataset:
    """Return a prepared run as the report draws it; flags of channels without any are left out."""
    idle = [
        str(name) for name in run.coords if str(name).endswith("_flags") and not run[name].any()
    ]
    return run.drop_vars(idle).astype(np.float32, keep_attrs=True)


def _training(plan: Plan, runs: Runs) -> xr.Dataset:
    edges = np.full((2, len(plan.training), len(runs)), np.nan)
    for number, each in enumerate(plan.training):
        for run, *span in each.spans:
            edges[:, number, list(runs).index(run)] = span
    left_out = [", ".join(each.left_out) for each in plan.training]
    out = xr.Dataset(
        {
            "begin": (("training", "of_run"), edges[0], {"units": "s"}),
            "end": (("training", "of_run"), edges[1], {"units": "s"}),
            "left_out": ("training", np.array(left_out, dtype=object)),
        },
        coords={"training": [each.name for each in plan.training], "of_run": list(runs)},
    )
    if all(len(each.spans) == 1 for each in plan.training):
        names, begins, stops = zip(*(each.spans[0] for each in plan.training), strict=True)
        lengths = np.subtract(stops, begins).clip(max=training_samples(plan.needs) * plan.dt)
        out["run"] = ("training", np.array(names, dtype=object))
        out["stop"] = ("training", np.array(stops))
        out["reads"] = ("training", lengths, {"units": "s"})
    return out


def _runs(plan: Plan, runs: Runs) -> xr.Dataset:
    """Data quality, run by run and channel by channel."""
    names = [*plan.states, *plan.inputs]
    numbers = ("mean", "sd", "min", "max", "constant", "slack")
    values = np.full((len(numbers), len(runs), len(names)), np.nan)
    for r, run in enumerate(runs.values()):
        for c, name in enumerate(names):
            x = run[name].values
            # A sample equal to both neighbours: a frozen sensor, or a limit that clips.
            same = (np.diff(x)[1:] == 0) & (np.diff(x)[:-1] == 0)
            noise = run[name].attrs.get("noise_std", 0.0)
            slack = slack_share(x, noise) if name.startswith("mooring") else np.nan
            spread = x.std(ddof=1)
            values[:, r, c] = x.mean(), spread, x.min(), x.max(), same.mean(), slack
    waves = [name for name in plan.inputs if is_elevation(name)]
    trained = {run for each in plan.training for run in each.runs}
    rows: list[dict[str, Any]] = []
    for name, run in runs.items():
        time, facts = run["time"].values, run.attrs
        is_regular = bool(waves) and facts.get("waves") == "regular"
        frequency = np.nan
        if is_regular:
            frequency = wave_frequency(between(run, whole_span(run))[waves[0]].values, plan.dt)
        rows.append(
            {
                "trains": name in trained,
                "water_depth": float(facts.get("water_depth", np.nan)),
                "wave_frequency": frequency,
                **{key: str(facts.get(key, "")) for key in WORDS},
                **{
                    f"{use}_{end}": facts.get(f"{use}_span", (np.nan, np.nan))[k]
                    for use in ("train", "test")
                    for k, end in enumerate(("begin", "end"))
                },
                "duration": float(time[-1] - time[0]),
                "samples": time.size,
            }
        )
    return xr.Dataset(
        {
            **{
                key: ("run", np.array([r[key] for r in rows], object if key in WORDS else None))
                for key in rows[0]
            },
            **{n: (("run", "name"), values[i]) for i, n in enumerate(numbers)},
        },
        coords={"run": list(runs), "name": names},
    )


def _spectra(plan: Plan, runs: Runs) -> xr.Dataset | None:
    """Spectra of the first wave elevation in all runs, as the paper and as recommended."""
    waves = [name for name in plan.inputs if is_elevation(name)]
    if not waves:
        return None
    curves, heights = {}, []
    for r, run in enumerate(runs.values()):
        x = run[waves[0]].sel(time=slice(whole_span(run)[0] - 1e-6, None)).values
        heights.append(significant_height(x))
        for k, kind in enumerate(WELCH):
            with suppress(RequestError):  # a record shorter than one segment
                welch = paper_welch(plan.dt) if kind == "paper" else ()
                curves[r, k] = wave_spectrum(x, plan.dt, *welch)
    bins = max((len(density) for _, density in curves.values()), default=0)
    values = np.full((2, len(runs), len(WELCH), bins), np.nan)
    for (r, k), curve in curves.items():
        values[:, r, k, : len(curve[0])] = curve
    return xr.Dataset(
        {
            "frequency": (("run", "kind", "bin"), values[0], {"units": "Hz"}),
            "density": (("run", "kind", "bin"), values[1], {"units": "m^2/Hz"}),
            "significant_height": ("run", np.array(heights), {"units": "m"}),
        },
        coords={"run": list(runs), "kind": list(WELCH)},
        attrs={"channel": waves[0]},
    )
