"""Data of a study: channels with their signs, runs with their quality, spectra."""

from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, Groups
from seakeep.campaign import Campaign
from seakeep.check.parts import is_regular, whole_span
from seakeep.conventions import is_elevation
from seakeep.core.spectra import dominant_frequency
from seakeep.errors import RequestError
from seakeep.metrics import slack_share
from seakeep.signals import significant_height, wave_spectrum
from seakeep.signals.waves import paper_welch
from seakeep.study.fit import find_repeat
from seakeep.study.judge import along, side_by_side
from seakeep.study.plan import Plan, between, parts_of, training_samples
from seakeep.study.settings import Study

POSITIVE = {
    "surge": "along the waves, from the place at rest",
    "sway": "to port, right-handed with x and z",
    "heave": "upwards",
    "roll": "right-handed about x",
    "pitch": "bow up (the bow points against the waves)",
    "yaw": "right-handed about z",
}


def describe_study(study: Study, plan: Plan) -> Groups:
    """Data that a study used."""
    groups = {
        "channels": _channels(study.campaign, plan),
        "training": _training(plan),
        "runs": _runs(plan),
        **{f"prepared/{name}": _prepared(run) for name, run in plan.runs.items()},
        "repeats": _repeats(plan),
        "spectra": _spectra(plan),
    }
    return {name: group for name, group in groups.items() if group is not None}


def _repeats(plan: Plan) -> xr.Dataset | None:
    """Runs whose test windows repeat input of their training set; None if there are none."""
    regular = {name for name, run in plan.runs.items() if is_regular(run)}
    rows = []
    for name in dict.fromkeys(each.run for each in plan.windows if each.run not in regular):
        spans = [
            (name, w.start, w.start + w.steps * plan.dt) for w in plan.windows if w.run == name
        ]
        sets = [each.spans for each in plan.training if each.may_test(name)]
        learnt = [span for of_set in sets for span in of_set if span[0] not in regular]
        pieces, (test,) = parts_of(plan.runs, learnt), parts_of(plan.runs, spans).values()
        if repeat := find_repeat(plan.inputs, pieces, name, test, plan.dt):
            rows.append(repeat)
    return along("run", rows) if rows else None


def words_of_repeats(repeats: xr.Dataset) -> str:
    """Say which test runs repeat training input, the one that repeats most in full."""
    worst = repeats.isel(run=int(np.argmax(repeats["share"].values)))
    others = [str(run) for run in repeats["run"].values if run != worst["run"]]
    more = f" So does that of {', '.join(others)}." if others else ""
    words = str(worst["words"].values)
    return f"{words[:1].upper()}{words[1:]}{more} Tests there show memory, not skill."


def _channels(campaign: Campaign, plan: Plan) -> xr.Dataset:
    first = next(iter(plan.runs.values()))
    rows = [
        {
            "name": name,
            "units": str(first[name].attrs.get("units", "")),
            "long_name": str(first[name].attrs.get("long_name", name)),
            "source": _source(campaign, name),
            "positive": _positive(name),
            "use": "state" if name in plan.states else "input",
        }
        for name in (*plan.states, *plan.inputs)
    ]
    out = along("name", rows).assign(channel=("channel", list(plan.states)))
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
    derived = settings.derived[name]
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


def _training(plan: Plan) -> xr.Dataset:
    """Spans of each training set in each run; the run and the stop where each has one alone."""
    runs, seconds = list(plan.runs), {"units": "s"}
    spans = [{run: edges for run, *edges in each.spans} for each in plan.training]
    edges = np.array([[of.get(run, [np.nan, np.nan]) for run in runs] for of in spans])
    over = ("training", "of_run")
    out = xr.Dataset(
        {
            "begin": (over, edges[..., 0], seconds),
            "end": (over, edges[..., 1], seconds),
            "left_out": ("training", [", ".join(each.left_out) for each in plan.training]),
        },
        coords={"training": [each.name for each in plan.training], "of_run": runs},
    )
    if all(len(each.spans) == 1 for each in plan.training):
        of_run, begins, stops = zip(*(each.spans[0] for each in plan.training), strict=True)
        lengths = np.subtract(stops, begins).clip(max=training_samples(plan.needs) * plan.dt)
        out["run"] = ("training", list(of_run))
        out["stop"] = ("training", list(stops))
        out["reads"] = ("training", lengths, seconds)
    return out


def _runs(plan: Plan) -> xr.Dataset:
    """Waves and spans of each run, and the part of the time at which its lines are slack."""
    names = [*plan.states, *plan.inputs]
    rows, slack = [], []
    for key, run in plan.runs.items():
        facts, frequency = run.attrs, np.nan
        if plan.waves is not None and is_regular(run):
            elevation = between(run, whole_span(run))[plan.waves].values
            frequency = dominant_frequency(elevation, plan.dt)
        train, test = (facts.get(f"{use}_span", (np.nan, np.nan)) for use in ("train", "test"))
        rows.append(
            {
                "run": key,
                "water_depth": float(facts.get("water_depth", np.nan)),
                "wave_frequency": frequency,
                "sea_state": str(facts.get("sea_state", "")),
                "waves": str(facts.get("waves", "")),
                "train_begin": train[0],
                "test_begin": test[0],
                "train_end": train[1],
                "test_end": test[1],
            }
        )
        slack.append(
            [
                slack_share(run[name].values, run[name].attrs.get("noise_std", 0.0))
                if name.startswith("mooring")
                else np.nan
                for name in names
            ]
        )
    return along("run", rows).assign_coords(name=names).assign(slack=(("run", "name"), slack))


def _spectra(plan: Plan) -> xr.Dataset | None:
    """Spectra of the first wave elevation in all runs, as the paper and as recommended."""
    waves = plan.waves
    if waves is None:
        return None

    def curve(x: FloatArray, how: tuple[Any, ...]) -> xr.Dataset:
        try:
            frequency, density = wave_spectrum(x, plan.dt, *how)
        except RequestError:  # a record shorter than one segment
            frequency, density = np.empty((2, 0))
        each = {
            "frequency": ("bin", frequency, {"units": "Hz"}),
            "density": ("bin", density, {"units": "m^2/Hz"}),
        }
        return xr.Dataset(each, {"bin": range(len(frequency))})

    records = {
        name: run[waves].sel(time=slice(whole_span(run)[0] - 1e-6, None)).values
        for name, run in plan.runs.items()
    }
    grid = [[curve(x, how) for how in (paper_welch(plan.dt), ())] for x in records.values()]
    names = {"run": list(records), "kind": ["paper", "recommended"]}
    out = side_by_side(grid, names).drop_vars("bin").assign_attrs(channel=waves)
    heights = [significant_height(x) for x in records.values()]
    return out.assign(significant_height=("run", heights, {"units": "m"}))
