"""Play a campaign: simulate its runs, record them, and write what a tank would deliver.

These are raw files as loggers write them, a campaign.toml, and the side view of a run as a video,
for the tracking of the white panel on the vessel. The video needs the extra ``video`` (OpenCV): its
frames are 1280 × 720 at the video clock's rate, the vessel moves in a plane of 2.5 mm per pixel,
and a lamp in the upper left corner shows the trigger.
"""

import io
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import ArrayLike, FloatArray, Progress
from seakeep.conventions import canonical_channel
from seakeep.errors import RequestError, SeakeepError, did_you_mean, naming
from seakeep.executor import in_order
from seakeep.files import MARK, check_output, is_there, make_folder, write_netcdf, write_text
from seakeep.signals.tracking import Image, opencv
from seakeep.tank.dynamics import Rig, assemble_rig, simulate
from seakeep.tank.hydrodynamics import excitation_at
from seakeep.tank.instruments import LOGGERS, Played, clock_instants, record_run, trigger
from seakeep.tank.seas import Sea, sea_of_run
from seakeep.tank.settings import TankSettings
from seakeep.toml import rendered

CAMPAIGN, RAW, TRUTH = "campaign", "raw file", "truth"
"""Kinds of files, as their marks say it."""

FIRST_LINE = r"time \[s\],(trigger \[V\]|lamp \[-\]|\w+ \[mm\]),.*"
"""First line of a raw text file."""

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
    of_time = {"units": "s", "long_name": "time, reference clock"}
    data = xr.Dataset(coords={"time": ("time", time, of_time)})
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


def write_record(record: xr.Dataset, path: Path) -> Path:
    """Write one logger's record to a folder that exists, by its suffix as ``.csv`` or ``.nc``.

    A sample that an instrument lost is an empty field in CSV, NaN in NetCDF.
    """
    rounded = record.map(lambda column: column.round(_decimals(column)), keep_attrs=True)
    if path.suffix == ".nc":
        write_netcdf(path, rounded.assign_attrs({MARK: RAW}))
        return path
    time = record["time"].values
    # As many decimals as the clock's readings need, up to six.
    exact = (d for d in range(1, 6) if np.allclose(np.round(time[:4], d), time[:4], atol=1e-9))
    decimals = [next(exact, 6), *map(_decimals, record.values())]
    # Adding zero turns the −0.0 of rounding into 0.0.
    table = np.column_stack([time.round(decimals[0]), *rounded.values()]) + 0.0
    rows = io.StringIO()
    np.savetxt(rows, table, [f"%.{d}f" for d in decimals], ",")
    heads = [f"{name} [{column.attrs['units']}]" for name, column in record.items()]
    head = ",".join(["time [s]", *heads])
    write_text(path, f"{head}\n{rows.getvalue().replace('nan', '')}")
    return path


def _decimals(column: xr.DataArray) -> int:
    """Decimals that a logger writes."""
    return {"m": 5, "mm": 2}.get(column.attrs["units"], 4)


def campaign_text(
    settings: TankSettings, files: Mapping[str, Mapping[str, str]], kind: str, one_logger: bool
) -> str:
    """Text of the campaign file.

    `files` holds run → instrument → file, relative to the campaign file; a video is named in a
    comment, since it is no table of a logger. `kind` is the format of the raw files.
    """
    # A single logger's file is for readers that know no gaps: its probes with drop-outs stay out.
    every = settings.instruments.probes
    # Low-passed channel of each probe without drop-outs: ``kn_fwd`` → ``eta_fwd``.
    short = {n: n.partition("_")[2] or n for n, probe in every.items() if probe.dropouts == 0}
    unique = len(set(short.values())) == len(short)
    filtered = {n: f"eta_{short[n]}" if unique else f"eta_{n}_filtered" for n in short}
    inputs = []
    if place := {name: every[name].position for name in filtered}:
        # The first probe downstream, and the one nearest to the vessel.
        near = min(place, key=lambda name: abs(place[name] - settings.vessel.position))
        inputs = list(dict.fromkeys(filtered[n] for n in (min(place, key=place.__getitem__), near)))
    return rendered(
        "tank",
        "campaign.toml",
        mark=f"{MARK}: {CAMPAIGN}",
        tank=settings,
        files_of=files,
        kind=kind,
        one_logger=one_logger,
        probes={name: each for name, each in every.items() if not (one_logger and each.dropouts)},
        filtered=filtered,
        lines=[f"mooring_{name}" for name in settings.moorings],
        inputs=inputs,
        metres_per_pixel=METRES_PER_PIXEL,
        panel=list(PANEL),
        panel_height=PANEL_HEIGHT,
        side_view=SIDE_VIEW,
    )


WIDTH, HEIGHT = 1280, 720
METRES_PER_PIXEL = 0.0025
PANEL = (0.30, 0.10)  # m
PANEL_HEIGHT = 0.25  # m, of its centre above the centre of gravity
SIDE_VIEW = "side_view"
"""Name of the camera's file beside those of the loggers."""
LEFT, TOP = -1.0, 1.1  # m, of the picture's upper left corner: x, height above still water
FRACTION_BITS = 6  # corners are placed to 1/64 pixel
SUBPIXELS = 8
NOISE = 3.0  # grey levels
NOISE_FRAMES = 12
HULL = ((-0.70, 0.20), (-0.62, -0.06), (-0.47, -0.083), (0.42, -0.083), (0.64, -0.03), (0.68, 0.20))
"""Outline of the CK-14e-like hull, m from the place at rest; any hull is drawn so."""


def pixel_of(x: float | FloatArray, z: float | FloatArray) -> FloatArray:
    """Pixels to the right and downwards from the first pixel's centre, of a point in the plane.

    `x` from the centre of gravity's at rest, `z` above still water, m.
    """
    return np.stack([x - LEFT, TOP - z], -1) / METRES_PER_PIXEL


def _turned(points: ArrayLike, centre: tuple[float, float], pitch: float) -> FloatArray:
    """Points of the vessel (m from its centre of gravity) after surge, heave and pitch."""
    x, z = np.asarray(points, float).T
    cosine, sine = np.cos(pitch), np.sin(pitch)
    return pixel_of(centre[0] + x * cosine + z * sine, centre[1] - x * sine + z * cosine)


def _corners(points: FloatArray) -> npt.NDArray[np.int32]:
    return np.round(points * 2**FRACTION_BITS).astype(np.int32)


def _light() -> npt.NDArray[np.float32]:
    """Lighting that falls off from the upper right."""
    right = np.linspace(0.72, 1.06, WIDTH)[None, :, None]
    down = np.linspace(1.05, 0.90, HEIGHT)[:, None, None]
    return np.repeat(right * down, 3, axis=2).astype(np.float32)


def frame_of(
    cv2: Any,
    motion: Iterable[float],
    surface: FloatArray,
    lamp: float,
    centre_of_gravity: float,
) -> Image:
    """One frame before lighting and noise, shape (720, 1280, 3).

    `motion` is surge (m), heave (m) and pitch (rad), `surface` the elevation (m) at equidistant
    points from the left to the right edge, `lamp` a brightness of 0 to 1.
    """
    surge, heave, pitch = motion
    centre = (surge, heave + centre_of_gravity)
    # The tank's wall: a vertical gradient with faint tiles.
    rows = np.linspace(105.0, 70.0, HEIGHT)[:, None, None] * np.array([1.0, 0.93, 0.82])
    wall = np.repeat(rows, WIDTH, axis=1)
    wall[::80] *= 0.88
    wall[:, ::80] *= 0.88
    frame = wall.astype(np.uint8)

    def polygon(picture: Image, points: FloatArray, colour: tuple[int, int, int]) -> None:
        corners = [_corners(points)]
        cv2.fillPoly(picture, corners, colour, lineType=cv2.LINE_AA, shift=FRACTION_BITS)

    hull = np.array(HULL) - [0.0, centre_of_gravity]
    polygon(frame, _turned(hull, centre, pitch), (40, 120, 190))
    post = [(-0.02, 0.1), (0.02, 0.1), (0.02, PANEL_HEIGHT), (-0.02, PANEL_HEIGHT)]
    polygon(frame, _turned(post, centre, pitch), (60, 60, 60))
    half = 0.5 * np.array(PANEL)
    panel = half * [[-1, -1], [1, -1], [1, 1], [-1, 1]] + [0.0, PANEL_HEIGHT]
    # The panel, each pixel by the part that it covers: OpenCV's own smoothed edges are off by up to
    # half a pixel, which would turn a level panel by 0.2 degrees.
    points = _turned(panel, centre, pitch)
    begin = np.maximum(np.floor(points.min(axis=0)).astype(int) - 1, 0)
    end = np.minimum(np.ceil(points.max(axis=0)).astype(int) + 2, [WIDTH, HEIGHT])
    if np.all(end > begin):
        width, height = (end - begin).tolist()
        fine = np.zeros((SUBPIXELS * height, SUBPIXELS * width), np.uint8)
        places = (points - begin + 0.5) * SUBPIXELS - 0.5
        cv2.fillPoly(fine, [_corners(places)], 255, shift=FRACTION_BITS)
        covered = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
        part = frame[begin[1] : end[1], begin[0] : end[0]]
        share = covered[:, :, None] / 255.0
        part[:] = np.round(part + share * (250 - part.astype(float))).astype(np.uint8)
    across = LEFT + METRES_PER_PIXEL * WIDTH * np.linspace(0.0, 1.0, surface.size)
    edge = pixel_of(across, surface)
    water = frame.copy()
    polygon(water, np.concatenate([edge, [[WIDTH, HEIGHT], [0, HEIGHT]]]), (95, 70, 30))
    frame = cv2.addWeighted(water, 0.75, frame, 0.25, 0.0)
    level = int(40 + 190 * np.clip(lamp, 0.0, 1.0))
    cv2.circle(frame, (40, 40), 14, (level // 4, level // 2, level), -1, cv2.LINE_AA)
    return frame


def _noise(cv2: Any, rng: np.random.Generator) -> list[npt.NDArray[np.float32]]:
    """Draw a stock of noise pictures; each frame takes one, shifted at random.

    The grain is four pixels wide, as a camera's compression leaves it; finer grain would make
    files of a gigabyte.
    """
    coarse = rng.normal(0.0, NOISE, (NOISE_FRAMES, HEIGHT // 4, WIDTH // 4)).astype(np.float32)
    return [cv2.resize(c, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR) for c in coarse]


def side_view(played: Played, rng: np.random.Generator, instants: ArrayLike) -> Iterator[Image]:
    """Frames (blue, green, red) as the camera at the tank's side would see them.

    At the given reference instants. Raises RequestError if OpenCV is not installed.
    """
    cv2 = opencv("rendering")
    time = np.asarray(instants, float)
    instruments = played.settings.instruments
    position, _, _ = played.states(time)
    lamp = trigger(time, instruments.trigger_period, instruments.trigger_width)
    across = LEFT + METRES_PER_PIXEL * WIDTH * np.linspace(0.0, 1.0, 41)
    place = played.settings.vessel.position
    surface = np.stack([played.elevation(place + x, time) for x in across], axis=1)
    light, stock = _light(), _noise(cv2, rng)
    height = played.rig.hydro.attrs["centre_of_gravity"]
    for motion, heights, brightness in zip(position[:3].T, surface, lamp, strict=True):
        frame = frame_of(cv2, motion, heights, brightness, height)
        grain = np.roll(stock[rng.integers(NOISE_FRAMES)], rng.integers(WIDTH), axis=1)
        lit = cv2.multiply(frame.astype(np.float32), light)
        lit += grain[:, :, None]
        yield np.clip(lit, 0, 255, out=lit).astype(np.uint8)


def render_side_view(played: Played, path: Path, rng: np.random.Generator) -> Path:
    """Render a run to an MP4 file.

    Raises
    ------
    RequestError
        If OpenCV is not installed.
    SeakeepError
        If it cannot write MP4 files here.
    """
    cv2 = opencv("rendering")
    clock = played.settings.instruments.clocks["video"]
    _, instants = clock_instants(clock, played.length)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        part = Path(folder) / "side_view.mp4"
        code = cv2.VideoWriter_fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(part), code, clock.rate, (WIDTH, HEIGHT))
        if not writer.isOpened():
            raise SeakeepError(
                "OpenCV cannot write MP4 files here. Install a build with FFmpeg: "
                "pip install opencv-python-headless"
            )
        for frame in side_view(played, rng, instants):
            writer.write(frame)
        writer.release()
        part.replace(path)
    return path
