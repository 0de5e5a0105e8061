"""Play a campaign: simulate its runs, record them, and write what a tank would deliver."""

import zlib
from collections.abc import Iterable
from concurrent.futures import Executor
from importlib import metadata
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.arrays import Progress
from seakeep.conventions import canonical_channel
from seakeep.errors import RequestError, did_you_mean, naming
from seakeep.executor import in_order
from seakeep.files import MARK, check_output, is_there, make_folder, write_netcdf, write_text
from seakeep.signals.tracking import opencv
from seakeep.tank.delivery import (
    CAMPAIGN,
    FIRST_LINE,
    RAW,
    SIDE_VIEW,
    TRUTH,
    campaign_text,
    render_side_view,
    write_record,
)
from seakeep.tank.dynamics import Rig, assemble_rig, simulate
from seakeep.tank.hydrodynamics import excitation_at
from seakeep.tank.instruments import LOGGERS, Played, record_run
from seakeep.tank.seas import Sea, sea_of_run
from seakeep.tank.settings import TankSettings

CAMPAIGN_FILE = "campaign.toml"
SINGLE_RATE = 100.0  # Hz, where all instruments share a logger
MARGIN = 2.0  # s simulated before and after what any logger records
STREAMS = {"waves": 0, "instruments": 1, "video": 3}


def generator(settings: TankSettings, run: str, stream: str) -> np.random.Generator:
    """Independent generator of a run's stream: adding or leaving out a run changes no other."""
    return np.random.default_rng([settings.seed, zlib.crc32(run.encode()), STREAMS[stream]])


def _sea(settings: TankSettings, rig: Rig, name: str) -> Sea:
    if name not in settings.runs:
        raise RequestError(
            f"there is no run {name!r}.{did_you_mean(name, settings.runs)} The runs are "
            f"{', '.join(settings.runs)}."
        )
    rng = generator(settings, name, "waves")
    sea = sea_of_run(name, settings.runs[name], settings.facility, rng)
    with naming(f"runs.{name}"):
        excitation_at(rig.hydro, sea.omega)
    return sea


def check_settings(settings: TankSettings, names: Iterable[str] | None = None) -> Rig:
    """Check all that can be refused before the named runs (by default all) are simulated.

    Returns
    -------
    Rig
        Vessel and moorings, ready to simulate.

    Raises
    ------
    RequestError
        If a run does not exist, or hydrodynamics, moorings, step or waves are not possible.
    """
    rig = assemble_rig(settings)
    for name in settings.runs if names is None else names:
        _sea(settings, rig, name)
    return rig


def play_run(settings: TankSettings, name: str, rig: Rig | None = None) -> Played:
    """Simulate one run, from a little before to a little after the record.

    A rig from :func:`check_settings` saves its making for each run.
    """
    assembled = rig or assemble_rig(settings)
    sea = _sea(settings, assembled, name)
    run = settings.runs[name]
    clocks = settings.instruments.clocks.values()
    beyond = max(abs(c.offset) + 1e-6 * abs(c.drift) * run.length for c in clocks) + MARGIN
    margin = assembled.step * np.ceil(beyond / assembled.step)
    motion = simulate(assembled, sea, run.length + 2 * margin, begin=-margin)
    return Played(settings, assembled, sea, motion, run.length)


POOL_AND_DRIFT = {
    "piston": ("m", "moon-pool piston elevation"),
    "slosh": ("m", "moon-pool sloshing elevation"),
    "surge_slow": ("m", "slow part of surge"),
}
"""Units and words of the true channels that no campaign has."""


def truth(played: Played, name: str, step: float | None = None) -> xr.Dataset:
    """All true channels of a run on the reference clock, without noise or slap.

    Parameters
    ----------
    played : Played
        The run.
    name : str
        Its name.
    step : float, optional
        Time step, s; the default is the simulation's.

    Returns
    -------
    Dataset
        Motions with rates and accelerations, pool, slow surge, loads, the linear elevation at
        each probe (``eta_NAME``) and at the moving vessel (``eta_vessel``), second-order crests
        (``eta_NAME_crest``); clocks and seed in the attributes.
    """
    settings = played.settings
    dt = step or played.rig.step
    time = dt * np.arange(int(played.length / dt + 1e-9) + 1, dtype=float)
    q, v, a = played.states(time)
    values = {}
    for index, dof in enumerate(played.rig.names):
        values[dof] = q[index]
        if index < 3:
            values[f"{dof}_rate"], values[f"{dof}_acceleration"] = v[index], a[index]
    values["surge_slow"] = np.interp(time, played.motion.time, played.motion.slow_surge)
    for line, load in zip(settings.moorings, played.loads(time), strict=True):
        values[f"mooring_{line}"] = load
    values["eta_vessel"] = played.elevation(settings.vessel.position + q[0], time)
    for probe, at in settings.instruments.probes.items():
        values[f"eta_{probe}"] = played.elevation(at.position, time)
        if settings.instruments.second_order:
            values[f"eta_{probe}_crest"] = played.crest(at.position, time)
    data = xr.Dataset(coords={"time": time})
    data["time"].attrs = {"units": "s", "long_name": "time, reference clock"}
    for key, value in values.items():
        channel = canonical_channel(key)
        unit, words = (channel.units, channel.long_name) if channel else POOL_AND_DRIFT[key]
        data[key] = "time", value, {"units": unit, "long_name": words}
    for probe, at in settings.instruments.probes.items():
        data[f"eta_{probe}"].attrs["x_position"] = at.position
    data.attrs = {
        MARK: TRUTH,
        "run": name,
        "seed": settings.seed,
        "startup": settings.runs[name].startup,
        "water_depth": settings.facility.water_depth,
        "x_position": settings.vessel.position,
        "frame": "x downstream, z up, pitch positive bow up; motions of the centre of gravity",
        "hydrodynamics": str(played.rig.hydro.attrs["mesh_sha256"]),
        "versions": ", ".join(f"{n} {metadata.version(n)}" for n in ("numpy", "scipy", "numba")),
        "settings": settings.model_dump_json(exclude={"vessel": {"hydrodynamics"}}),
    }
    for logger, clock in settings.instruments.clocks.items():
        data.attrs[f"clock_{logger}_offset"] = clock.offset
        data.attrs[f"clock_{logger}_drift_ppm"] = clock.drift
    return data


def _check_outputs(folder: Path, names: list[str], kind: str) -> None:
    """Refuse to overwrite a campaign file or a record that the tank has not written."""
    if is_there(folder / CAMPAIGN_FILE):
        check_output(folder / CAMPAIGN_FILE, CAMPAIGN)
    for name in names:
        raw, hidden = folder / "raw" / name, folder / "truth" / f"{name}.nc"
        written = [path for path in raw.glob("*") if path.suffix in (f".{kind}", ".mp4")]
        if written and not hidden.exists():  # which is written first
            raise RequestError(
                f"{written[0]} exists, and no truth of the tank beside it; it may be a "
                "measurement. Choose another folder."
            )
        if hidden.exists():
            check_output(hidden, TRUTH)
        for path in written:
            if path.stem in (*LOGGERS, "all"):
                check_output(path, RAW, header=FIRST_LINE)


def play(
    settings: TankSettings,
    out: Path | str,
    *,
    kind: str = "csv",
    one_logger: bool = False,
    names: Iterable[str] | None = None,
    videos: Iterable[str] = (),
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> dict[str, dict[str, Path]]:
    """Play a campaign and write raw files, campaign.toml and, in a folder apart, the truth.

    Parameters
    ----------
    settings : TankSettings
        The settings.
    out : path
        Folder to write to; made if it does not exist.
    kind : {"csv", "nc"}, optional
        Format of the raw files.
    one_logger : bool, optional
        Record all instruments on one logger (one file per run, no clock errors) instead of one
        file per instrument.
    names : iterable of str, optional
        Runs; the default is all.
    videos : iterable of str, optional
        Runs of which to render the side view as MP4 (extra ``video``).
    executor : Executor, optional
        Plays runs side by side, on this machine.
    progress : callable, optional
        Called as ``progress(done, total, name)`` after each run.

    Returns
    -------
    dict of str to mapping of str to Path
        Run → instrument → file.

    Raises
    ------
    RequestError
        If a setting is wrong, or a file in the folder is not the tank's; nothing has been
        written then.
    DivergenceError
        If a simulation diverges.
    """
    if kind not in ("csv", "nc"):
        raise RequestError(f"raw files are 'csv' or 'nc'; received {kind!r}. Choose one.")
    chosen, filmed = list(settings.runs if names is None else names), list(videos)
    if not chosen:
        raise RequestError("no run was asked for. Add a table [runs.NAME] to the settings.")
    if filmed:
        opencv("rendering")
    rig = check_settings(settings, [*chosen, *filmed])
    part = settings.model_copy(update={"runs": {n: settings.runs[n] for n in chosen}})
    folder = Path(out)
    _check_outputs(folder, chosen, kind)
    asked = part, rig, folder, kind, one_logger, filmed
    files = {}
    for name, made in zip(chosen, in_order(_record_run, asked, chosen, executor), strict=True):
        files[name] = made
        if progress:
            progress(len(files), len(chosen), name)
    relative = {
        run: {key: path.relative_to(folder).as_posix() for key, path in paths.items()}
        for run, paths in files.items()
    }
    write_text(folder / CAMPAIGN_FILE, campaign_text(part, relative, kind, one_logger))
    return files


def _record_run(
    asked: tuple[TankSettings, Rig, Path, str, bool, list[str]], name: str
) -> dict[str, Path]:
    """Play a run, and write its truth and its raw files."""
    settings, rig, folder, kind, one_logger, filmed = asked
    played = play_run(settings, name, rig)
    raw, hidden = make_folder(folder / "raw" / name), make_folder(folder / "truth")
    write_netcdf(hidden / f"{name}.nc", truth(played, name))
    rng = generator(settings, name, "instruments")
    records = record_run(played, rng, SINGLE_RATE if one_logger else None)
    files = {each: write_record(record, raw / f"{each}.{kind}") for each, record in records.items()}
    if name in filmed:
        files[SIDE_VIEW] = render_side_view(
            played, raw / f"{SIDE_VIEW}.mp4", generator(settings, name, "video")
        )
    return files
