"""Files that the virtual tank delivers: raw files as loggers write them, and a campaign.toml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import xarray as xr

from seakeep.files import MARK, replacing, write_netcdf
from seakeep.tank.instruments import Record
from seakeep.tank.settings import RunPlan, TankSettings
from seakeep.tank.video import METRES_PER_PIXEL, PANEL, PANEL_HEIGHT, SIDE_VIEW

__all__ = [
    "CAMPAIGN",
    "FIRST_LINE",
    "RAW",
    "TRUTH",
    "campaign_text",
    "write_dataset",
    "write_record",
    "write_text",
]

CAMPAIGN, RAW, TRUTH = "campaign", "raw file", "truth"
"""Kinds of files, as their marks say it."""

FIRST_LINE = r"time \[s\],(trigger \[V\]|lamp \[-\]|\w+ \[mm\]),.*"
"""First line of a raw text file."""
ROWS_AT_ONCE = 20_000
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


def _csv(record: Record) -> str:
    heads = [_header("time", "s")]
    heads += [_header(name, column.unit) for name, column in record.columns.items()]
    # As many decimals as the clock's readings need, up to six.
    start = record.time[:4]
    needed = (d for d in range(1, 6) if np.allclose(np.round(start, d), start, atol=1e-9))
    decimals = [next(needed, 6)] + [c.decimals for c in record.columns.values()]
    line = ",".join(f"%.{d}f" for d in decimals) + "\n"
    columns = [record.time] + [c.values for c in record.columns.values()]
    # Adding zero turns the −0.0 of rounding into 0.0.
    table = np.column_stack([np.round(c, d) for c, d in zip(columns, decimals, strict=True)]) + 0.0
    parts = [",".join(heads) + "\n"]
    for first in range(0, len(table), ROWS_AT_ONCE):
        rows = table[first : first + ROWS_AT_ONCE]
        parts.append(((line * len(rows)) % tuple(rows.ravel().tolist())).replace("nan", ""))
    return "".join(parts)


def write_record(record: Record, folder: Path, kind: str) -> Path:
    """Write one logger's record to a folder that exists, as ``"csv"`` or ``"nc"``.

    A sample that an instrument lost is an empty field in CSV, NaN in NetCDF.
    """
    path = folder / f"{record.name}.{kind}"
    if kind == "csv":
        write_text(path, _csv(record))
        return path
    data = xr.Dataset(
        {
            name: ("time", np.round(column.values, column.decimals), {"units": column.unit})
            for name, column in record.columns.items()
        },
        coords={"time": ("time", record.time, {"units": "s"})},
        attrs={MARK: RAW},
    )
    write_dataset(data, path)
    return path


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


def _inputs(settings: TankSettings) -> list[str]:
    """Return the channels that drive a model: the first probe downstream and one at rest."""
    channels, place = _filtered(settings), settings.vessel.position
    at = {name: settings.instruments.probes[name].position for name in channels}
    if not at:
        return []
    near = min(at, key=lambda name: abs(at[name] - place))
    return [channels[name] for name in dict.fromkeys((min(at, key=lambda n: at[n]), near))]


def _channels(settings: TankSettings, probes: list[str], kind: str) -> dict[str, dict[str, str]]:
    columns = {f"eta_{name}": (name, "mm") for name in probes} | MOTIONS
    columns["surge"] = ("surge", "m")
    columns |= {f"mooring_{name}": (f"mooring_{name}", "N") for name in settings.moorings}
    channels = {
        channel: {"column": _header(name, unit) if kind == "csv" else name, "unit": unit}
        for channel, (name, unit) in columns.items()
    }
    channels["surge"]["long_name"] = "surge, tracked in the video"
    return channels


def _instruments(settings: TankSettings) -> dict[str, Any]:
    """Each logger has a clock of its own; all record the same trigger pulses."""
    tables: dict[str, Any] = {"reference": "wave_probes"}
    for name, clock in settings.instruments.clocks.items():
        trigger, unit = ("lamp", "-") if name == "video" else ("trigger", "V")
        tables[name] = {"sampling_rate": clock.rate, "trigger": trigger, "trigger_unit": unit}
    tables["video"] |= {
        "metres_per_pixel": METRES_PER_PIXEL,
        "panel": list(PANEL),
        "panel_height": PANEL_HEIGHT,
    }
    return tables


def _run(run: RunPlan, files: Mapping[str, str], one_logger: bool) -> dict[str, Any]:
    waves = "regular" if run.spectrum is None else "irregular"
    begin, end = run.startup, run.length
    middle = 0.5 * (begin + end)
    table: dict[str, Any] = {"sea_state": run.sea_state or waves, "waves": waves}
    if run.role == "both":
        table |= {"train": [begin, middle], "test": [middle, end]}
    else:
        table |= {"role": run.role, "span": [begin, end]}
    loggers = {key: path for key, path in files.items() if key != SIDE_VIEW}
    if one_logger:
        return {"file": next(iter(loggers.values()))} | table
    return table | {"files": loggers}


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
    positions = {f"eta_{name}": every[name].position for name in probes}
    positions |= {channel: every[name].position for name, channel in filtered.items()}
    low_passed = {channel: {"from": f"eta_{n}"} | LOW_PASS for n, channel in filtered.items()}
    states = [*STATES, *(f"mooring_{name}" for name in settings.moorings)]
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
            "positions": positions,
        },
        "channels": _channels(settings, probes, kind),
        "derived": low_passed | DERIVED,
        "instruments": _instruments(settings),
        "runs": {n: _run(run, files[n], one_logger) for n, run in settings.runs.items()},
        "preparation": {"preset": "paper", "gaps": "mask"},
        "model": {
            "kind": "hankel_dmdc", "preset": "paper", "states": states, "inputs": _inputs(settings),
        },
    }  # fmt: skip
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
