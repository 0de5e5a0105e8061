"""Files that the virtual tank delivers: raw files as loggers write them, and a campaign.toml."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import xarray as xr

from seakeep.files import MARK, replacing, write_netcdf
from seakeep.tank.settings import RunPlan, TankSettings
from seakeep.tank.video import METRES_PER_PIXEL, PANEL, PANEL_HEIGHT, SIDE_VIEW

CAMPAIGN, RAW, TRUTH = "campaign", "raw file", "truth"
"""Kinds of files, as their marks say it."""

FIRST_LINE = r"time \[s\],(trigger \[V\]|lamp \[-\]|\w+ \[mm\]),.*"
"""First line of a raw text file."""
MOTIONS = {
    "heave": ("heave", "m"),
    "pitch": ("pitch", "deg"),
    "pitch_rate": ("rate_y", "deg/s"),
    "surge_acceleration": ("acceleration_x", "m/s^2"),
    "heave_acceleration": ("acceleration_z", "m/s^2"),
}
DERIVED = {
    # Above the band the low-pass filter of [preparation] ends what is integrated, as in the paper.
    "surge_rate": {"from": "surge_acceleration", "step": "integrate", "band": [0.2, 15.0]},
    "heave_rate": {"from": "heave_acceleration", "step": "integrate", "band": [0.2, 15.0]},
    "pitch_acceleration": {"from": "pitch_rate", "step": "differentiate"},
}
LOW_PASS = {"step": "low_pass", "passband": 10.0, "stopband": 10.75}  # Hz, of the paper
STATES = (
    "surge", "heave", "pitch", "surge_rate", "heave_rate", "pitch_rate",
    "surge_acceleration", "heave_acceleration", "pitch_acceleration",
)  # fmt: skip
HEADING = (
    f"{MARK}: {CAMPAIGN}",
    "Written by `seakeep tank`. Spans are in seconds of the reference clock (wave probes);",
    "what lies before them is the start-up of the waves: cut it from every analysis.",
)


def _header(name: str, unit: str) -> str:
    """Head of a column of a text file."""
    return f"{name} [{unit}]"


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then rename it."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_record(record: xr.Dataset, path: Path) -> Path:
    """Write one logger's record to a folder that exists, by its suffix as ``.csv`` or ``.nc``.

    A sample that an instrument lost is an empty field in CSV, NaN in NetCDF.
    """
    rounded = record.map(lambda column: column.round(_decimals(column)), keep_attrs=True)
    if path.suffix == ".nc":
        write_dataset(rounded.assign_attrs({MARK: RAW}), path)
        return path
    time = record["time"].values
    # As many decimals as the clock's readings need, up to six.
    exact = (d for d in range(1, 6) if np.allclose(np.round(time[:4], d), time[:4], atol=1e-9))
    decimals = [next(exact, 6), *map(_decimals, record.values())]
    # Adding zero turns the −0.0 of rounding into 0.0.
    table = np.column_stack([time.round(decimals[0]), *rounded.values()]) + 0.0
    rows = io.StringIO()
    np.savetxt(rows, table, [f"%.{d}f" for d in decimals], ",")
    heads = [_header(str(name), column.attrs["units"]) for name, column in record.items()]
    head = ",".join([_header("time", "s"), *heads])
    write_text(path, f"{head}\n{rows.getvalue().replace('nan', '')}")
    return path


def _decimals(column: xr.DataArray) -> int:
    """Decimals that a logger writes."""
    return {"m": 5, "mm": 2}.get(column.attrs["units"], 4)


def write_dataset(data: xr.Dataset, path: Path) -> None:
    """Write a Dataset to NetCDF, compressed, under a temporary name, then rename it."""
    with replacing(path) as temporary:
        packed = {str(name): {"zlib": True, "complevel": 4} for name in data.data_vars}
        write_netcdf(temporary, data, packed)


def _filtered(settings: TankSettings) -> dict[str, str]:
    """Low-passed channel of each probe without drop-outs: ``kn_fwd`` → ``eta_fwd``."""
    probes = settings.instruments.probes
    short = {n: n.partition("_")[2] or n for n, probe in probes.items() if probe.dropouts == 0}
    unique = len(set(short.values())) == len(short)
    return {name: f"eta_{short[name]}" if unique else f"eta_{name}_filtered" for name in short}


def _run(run: RunPlan, files: Mapping[str, str], one_logger: bool) -> dict[str, Any]:
    waves = "regular" if run.spectrum is None else "irregular"
    begin, end = run.startup, run.length
    middle = 0.5 * (begin + end)
    loggers = {key: path for key, path in files.items() if key != SIDE_VIEW}
    named = {"file": next(iter(loggers.values()))} if one_logger else {"files": loggers}
    table: dict[str, Any] = {"sea_state": run.sea_state or waves, "waves": waves}
    if run.role == "both":
        table |= {"train": [begin, middle], "test": [middle, end]}
    else:
        table |= {"role": run.role, "span": [begin, end]}
    return named | table if one_logger else table | named


def campaign_text(
    settings: TankSettings, files: Mapping[str, Mapping[str, str]], kind: str, one_logger: bool
) -> str:
    """Text of the campaign file.

    `files` holds run → instrument → file, relative to the campaign file; a video is named in a
    comment, since it is no table of a logger. `kind` is the format of the raw files.
    """
    # A single logger's file is for readers that know no gaps: its probes with drop-outs stay out.
    every = settings.instruments.probes
    probes = [name for name in every if not (one_logger and every[name].dropouts)]
    filtered = _filtered(settings)
    place = {name: every[name].position for name in filtered}
    inputs = []
    if place:  # the first probe downstream, and the one nearest to the vessel
        near = min(place, key=lambda name: abs(place[name] - settings.vessel.position))
        inputs = list(dict.fromkeys(filtered[n] for n in (min(place, key=place.__getitem__), near)))
    lines = [f"mooring_{name}" for name in settings.moorings]
    columns = {f"eta_{name}": (name, "mm") for name in probes} | MOTIONS
    columns |= {"surge": ("surge", "m")} | {line: (line, "N") for line in lines}
    channels = {
        channel: {"column": _header(name, unit) if kind == "csv" else name, "unit": unit}
        for channel, (name, unit) in columns.items()
    }
    channels["surge"]["long_name"] = "surge, tracked in the video"
    instruments: dict[str, Any] = {"reference": "wave_probes"}
    for logger, clock in settings.instruments.clocks.items():  # all record the same pulses
        trigger, unit = ("lamp", "-") if logger == "video" else ("trigger", "V")
        instruments[logger] = {
            "sampling_rate": clock.rate,
            "trigger": trigger,
            "trigger_unit": unit,
        }
    instruments["video"] |= {
        "metres_per_pixel": METRES_PER_PIXEL,
        "panel": list(PANEL),
        "panel_height": PANEL_HEIGHT,
    }
    tables: dict[str, Any] = {
        "campaign": {
            "name": settings.name,
            "description": f"Virtual towing tank, seed {settings.seed}",
            "scale_factor": settings.scale_factor,
        },
        "rig": {
            "water_depth": settings.facility.water_depth,
            "wave_direction": 0.0,
            "frame": "x downstream, z up, pitch positive bow up; surge from the place at rest",
            "positions": {f"eta_{name}": every[name].position for name in probes}
            | {filtered[name]: position for name, position in place.items()},
        },
        "channels": channels,
        "derived": {filtered[n]: {"from": f"eta_{n}"} | LOW_PASS for n in filtered} | DERIVED,
        "instruments": instruments,
        "runs": {n: _run(run, files[n], one_logger) for n, run in settings.runs.items()},
        "preparation": {"preset": "paper", "gaps": "mask"},
        "model": {
            "kind": "hankel_dmdc",
            "preset": "paper",
            "states": [*STATES, *lines],
            "inputs": inputs,
        },
    }
    if one_logger:
        del tables["instruments"], tables["preparation"]["gaps"]
    document = tomlkit.document()
    for line in HEADING:
        document.add(tomlkit.comment(line))
    for name, table in tables.items():
        document.add(tomlkit.nl())
        document.add(name, tomlkit.item(table))
    for name, paths in files.items():
        if SIDE_VIEW in paths:
            filmed = f"Filmed: {paths[SIDE_VIEW]}, for `seakeep track`."
            document["runs"][name].comment(filmed)
    return tomlkit.dumps(document)
