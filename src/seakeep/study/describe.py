"""Data of a study: channels with their signs, runs with their quality, spectra."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.campaign import Campaign
from seakeep.check.parts import whole_span
from seakeep.conventions import is_elevation
from seakeep.core.harmonics import dominant_frequency
from seakeep.core.metrics import slack_share
from seakeep.errors import RequestError
from seakeep.signals import significant_height, wave_spectrum
from seakeep.signals.waves import paper_welch
from seakeep.study.fit import find_repeat
from seakeep.study.plan import Plan, between, trained_parts, training_samples
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


def _table(rows: Sequence[Mapping[str, Any]], dim: str, names: Iterable[str]) -> xr.Dataset:
    """Rows of the same keys as variables along a dimension."""
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return xr.Dataset({key: (dim, each) for key, each in columns.items()}, {dim: list(names)})


def _repeats(campaign: Campaign, plan: Plan, runs: Runs) -> xr.Dataset | None:
    """Runs whose test windows repeat input of their training set; None if there are none."""
    regular = {name for name, run in campaign.settings.runs.items() if run.waves == "regular"}
    windows = [each for of_test in plan.tests.values() for each in of_test]
    repeats = {}
    for name in dict.fromkeys(each.run for each in windows if each.run not in regular):
        starts = [each.start for each in windows if each.run == name]
        ends = [each.start + each.steps * plan.dt for each in windows if each.run == name]
        learnt = trained_parts([each for each in plan.training if each.may_test(name)], runs)
        pieces = {run: part for run, part in learnt.items() if run not in regular}
        test = between(runs[name], (min(starts), max(ends)))
        if (repeat := find_repeat(plan.inputs, pieces, name, test, plan.dt)) is not None:
            repeats[name] = {**asdict(repeat), "words": str(repeat)}
    rows = [{key: value for key, value in row.items() if key != "run"} for row in repeats.values()]
    return _table(rows, "run", repeats) if repeats else None


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
            "source": _source(campaign, name),
            "positive": _positive(name),
            "use": "state" if name in plan.states else "input",
        }
        for name in names
    ]
    out = _table(rows, "name", names).assign(channel=("channel", list(plan.states)))
    return out.assign_attrs(frame=campaign.settings.rig.frame or "")


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
    derived = settings.derived.get(name)
    if derived is None:
        return ""
    if derived.expression is not None:
        return derived.expression
    words = {"integrate": "integral", "differentiate": "derivative"}
    return f"{words.get(str(derived.step), str(derived.step))} of {derived.source}".replace(
        "_", " "
    )


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
    """Spans of each training set in each run; the run and the stop where each has one alone."""
    names = [each.name for each in plan.training]
    edges = np.full((2, len(names), len(runs)), np.nan)
    for number, each in enumerate(plan.training):
        for run, *span in each.spans:
            edges[:, number, list(runs).index(run)] = span
    left_out = [", ".join(each.left_out) for each in plan.training]
    out = xr.Dataset(
        {
            "begin": (("training", "of_run"), edges[0], {"units": "s"}),
            "end": (("training", "of_run"), edges[1], {"units": "s"}),
            "left_out": ("training", left_out),
        },
        coords={"training": names, "of_run": list(runs)},
    )
    if all(len(each.spans) == 1 for each in plan.training):
        of_run, begins, stops = zip(*(each.spans[0] for each in plan.training), strict=True)
        lengths = np.subtract(stops, begins).clip(max=training_samples(plan.needs) * plan.dt)
        out["run"] = ("training", list(of_run))
        out["stop"] = ("training", list(stops))
        out["reads"] = ("training", lengths, {"units": "s"})
    return out


def _runs(plan: Plan, runs: Runs) -> xr.Dataset:
    """Waves and spans of each run, and the part of the time at which its lines are slack."""
    waves = next(filter(is_elevation, plan.inputs), None)
    rows = []
    for run in runs.values():
        facts, frequency, nowhere = run.attrs, np.nan, (np.nan, np.nan)
        if waves is not None and facts.get("waves") == "regular":
            elevation = between(run, whole_span(run))[waves].values
            frequency = dominant_frequency(elevation, plan.dt)
        spans = {use: facts.get(f"{use}_span", nowhere) for use in ("train", "test")}
        rows.append(
            {
                "water_depth": float(facts.get("water_depth", np.nan)),
                "wave_frequency": frequency,
                "sea_state": str(facts.get("sea_state", "")),
                "waves": str(facts.get("waves", "")),
                **{f"{use}_begin": span[0] for use, span in spans.items()},
                **{f"{use}_end": span[1] for use, span in spans.items()},
            }
        )
    names = [*plan.states, *plan.inputs]
    slack = np.full((len(runs), len(names)), np.nan)
    for r, run in enumerate(runs.values()):
        for c, name in enumerate(names):
            if name.startswith("mooring"):
                slack[r, c] = slack_share(run[name].values, run[name].attrs.get("noise_std", 0.0))
    out = _table(rows, "run", runs).assign_coords(name=names)
    return out.assign(slack=(("run", "name"), slack))


def _spectra(plan: Plan, runs: Runs) -> xr.Dataset | None:
    """Spectra of the first wave elevation in all runs, as the paper and as recommended."""
    waves = next(filter(is_elevation, plan.inputs), None)
    if waves is None:
        return None

    def curve(x: FloatArray, kind: str) -> xr.Dataset:
        try:
            how = paper_welch(plan.dt) if kind == "paper" else ()
            frequency, density = wave_spectrum(x, plan.dt, *how)
        except RequestError:  # a record shorter than one segment
            frequency, density = np.empty((2, 0))
        each = {
            "frequency": ("bin", frequency, {"units": "Hz"}),
            "density": ("bin", density, {"units": "m^2/Hz"}),
        }
        return xr.Dataset(each, {"bin": range(len(frequency))})

    records = [run[waves].sel(time=slice(whole_span(run)[0] - 1e-6, None)) for run in runs.values()]
    kinds, names = xr.Variable("kind", list(WELCH)), xr.Variable("run", list(runs))
    each = [
        xr.concat([curve(x.values, kind) for kind in WELCH], kinds, join="outer") for x in records
    ]
    out = xr.concat(each, names, join="outer").drop_vars("bin").assign_attrs(channel=waves)
    heights = [significant_height(x.values) for x in records]
    return out.assign(significant_height=("run", heights, {"units": "m"}))
