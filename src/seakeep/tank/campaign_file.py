"""The campaign.toml that the virtual tank delivers with its raw files."""

from __future__ import annotations

from collections.abc import Mapping

from seakeep.tank.raw_files import header
from seakeep.tank.settings import RunSettings, TankSettings
from seakeep.tank.video import METRES_PER_PIXEL, PANEL, PANEL_HEIGHT, SIDE_VIEW

__all__ = ["campaign_text"]

MOTIONS = {
    "heave": ("heave", "m"),
    "pitch": ("pitch", "deg"),
    "pitch_rate": ("rate_y", "deg/s"),
    "surge_acceleration": ("acceleration_x", "m/s^2"),
    "heave_acceleration": ("acceleration_z", "m/s^2"),
}
STATES = (
    "surge", "heave", "pitch", "surge_rate", "heave_rate", "pitch_rate",
    "surge_acceleration", "heave_acceleration", "pitch_acceleration",
)  # fmt: skip
EDGES = (10.0, 10.75)  # Hz, of the paper's low-pass filter
BAND = (0.2, 5.0)  # Hz, of the accelerations that are integrated
CROSSOVER = 0.15  # Hz, between slow drift and waves


def _quoted(value: str) -> str:
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _column(name: str, unit: str, kind: str) -> str:
    return header(name, unit) if kind == "csv" else name


def _channel(name: str, column: str, unit: str, long_name: str = "") -> list[str]:
    lines = [f"[channels.{name}]", f"column = {_quoted(column)}", f"unit = {_quoted(unit)}"]
    if long_name:
        lines.append(f"long_name = {_quoted(long_name)}")
    return [*lines, ""]


def _filtered(settings: TankSettings) -> dict[str, str]:
    """Low-passed channel of each probe without drop-outs: ``kn_fwd`` → ``eta_fwd``."""
    probes = settings.instruments.probes
    sound = [name for name in probes if probes[name].dropouts == 0]
    short = {name: name.partition("_")[2] or name for name in sound}
    unique = len(set(short.values())) == len(short)
    return {name: f"eta_{short[name]}" if unique else f"eta_{name}_filtered" for name in sound}


def _inputs(settings: TankSettings) -> list[str]:
    """Return the channels that drive a model: the first probe downstream and one at rest."""
    channels = _filtered(settings)
    probes = {name: settings.instruments.probes[name] for name in channels}
    if not probes:
        return []
    first = min(probes, key=lambda n: probes[n].position)
    near = min(probes, key=lambda n: abs(probes[n].position - settings.vessel.position))
    return [channels[n] for n in dict.fromkeys((first, near))]


def _spans(run: RunSettings) -> list[str]:
    begin, end = run.startup, run.startup + run.duration
    middle = 0.5 * (begin + end)
    if run.role == "both":
        return [f"train = [{begin:g}, {middle:g}]", f"test = [{middle:g}, {end:g}]"]
    return [f"role = {_quoted(run.role)}", f"span = [{begin:g}, {end:g}]"]


def _head(settings: TankSettings, lost: bool) -> list[str]:
    probes = settings.instruments.probes
    positions = {
        f"eta_{name}": probe.position
        for name, probe in probes.items()
        if lost or probe.dropouts == 0
    }
    positions |= {channel: probes[name].position for name, channel in _filtered(settings).items()}
    return [
        "# Written by `seakeep tank`. Spans are in seconds of the reference clock (wave probes);",
        "# what lies before them is the start-up of the waves: cut it from every analysis.",
        "",
        "[campaign]",
        f"name = {_quoted(settings.name)}",
        f'description = "Virtual towing tank, seed {settings.seed}"',
        f"scale_factor = {settings.scale_factor:g}",
        "",
        "[rig]",
        f"water_depth = {settings.facility.water_depth:g}",
        "wave_direction = 0.0",
        'frame = "x downstream, z up, pitch positive bow up; surge from the place at rest"',
        "",
        "[rig.positions]",
        *[f"{name} = {place:g}" for name, place in positions.items()],
        "",
    ]


def _channels(settings: TankSettings, kind: str, lost: bool) -> list[str]:
    lines = []
    for name, probe in settings.instruments.probes.items():
        if lost or probe.dropouts == 0:
            lines += _channel(f"eta_{name}", _column(name, "mm", kind), "mm")
    for channel, (column, unit) in MOTIONS.items():
        lines += _channel(channel, _column(column, unit, kind), unit)
    lines += _channel("surge", _column("surge", "m", kind), "m", "surge, tracked in the video")
    for name in settings.moorings:
        column = _column(f"mooring_{name}", "N", kind)
        lines += _channel(f"mooring_{name}", column, "N")
    for name, channel in _filtered(settings).items():
        lines += [
            f"[derived.{channel}]",
            f'from = "eta_{name}"',
            'step = "low_pass"',
            f"passband = {EDGES[0]}",
            f"stopband = {EDGES[1]}",
            "",
        ]
    # Surge drifts slowly: its rate keeps what the video sees of that.
    lines += [
        "[derived.surge_rate]",
        'from = "surge_acceleration"',
        'step = "complementary_filter"',
        'position = "surge"',
        f"crossover = {CROSSOVER}",
        "",
        "[derived.heave_rate]",
        'from = "heave_acceleration"',
        'step = "integrate"',
        f"band = [{BAND[0]}, {BAND[1]}]",
        "",
    ]
    return [
        *lines,
        "[derived.pitch_acceleration]",
        'from = "pitch_rate"',
        'step = "differentiate"',
        "",
    ]


def _instruments(settings: TankSettings) -> list[str]:
    lines = [
        "# Each logger has a clock of its own; all record the same trigger pulses.",
        "[instruments]",
        'reference = "wave_probes"',
        "",
    ]
    for name, clock in settings.instruments.clocks.items():
        trigger, unit = ("lamp", "-") if name == "video" else ("trigger", "V")
        lines += [
            f"[instruments.{name}]",
            f"sampling_rate = {clock.rate:g}",
            f"trigger = {_quoted(trigger)}",
            f"trigger_unit = {_quoted(unit)}",
        ]
        if name == "video":
            lines += [
                f"metres_per_pixel = {METRES_PER_PIXEL}",
                f"panel = [{PANEL[0]}, {PANEL[1]}]  # m, white, on the vessel",
                f"panel_height = {PANEL_HEIGHT}  # m, of its centre above the centre of gravity",
            ]
        lines.append("")
    return lines


def campaign_text(
    settings: TankSettings, files: Mapping[str, Mapping[str, str]], kind: str, one_logger: bool
) -> str:
    """Text of the campaign file.

    Parameters
    ----------
    settings : TankSettings
        The settings.
    files : mapping of str to mapping of str to str
        Run → instrument → file, relative to the campaign file; a video is named in a comment, since
        it is no table of a logger.
    kind : {"csv", "nc"}
        Format of the raw files.
    one_logger : bool
        Whether all instruments share a logger (one file a run).

    Returns
    -------
    str
        TOML.
    """
    # A single logger's file is for readers that know no gaps: its probes with drop-outs stay out.
    lost = not one_logger
    lines = _head(settings, lost) + _channels(settings, kind, lost)
    if not one_logger:
        lines += _instruments(settings)
    for name, run in settings.runs.items():
        loggers = {key: path for key, path in files[name].items() if key != SIDE_VIEW}
        lines += [f"[runs.{name}]"]
        if SIDE_VIEW in files[name]:
            lines.append(f"# Filmed: {files[name][SIDE_VIEW]}, for `seakeep track`.")
        if one_logger:
            lines.append(f"file = {_quoted(next(iter(loggers.values())))}")
        waves = "irregular" if run.irregular else "regular"
        lines += [f"sea_state = {_quoted(run.sea_state or waves)}", f'waves = "{waves}"']
        lines += _spans(run)
        if not one_logger:
            lines += ["", f"[runs.{name}.files]"]
            lines += [f"{key} = {_quoted(path)}" for key, path in loggers.items()]
        lines.append("")
    states = [*STATES, *(f"mooring_{name}" for name in settings.moorings)]
    return "\n".join(
        [
            *lines,
            "[preparation]",
            "steps_per_period = 32",
            *(['gaps = "mask"'] if lost else []),
            "",
            "[model]",
            'kind = "hankel_dmdc"',
            'preset = "paper"',
            f"states = [{', '.join(map(_quoted, states))}]",
            f"inputs = [{', '.join(map(_quoted, _inputs(settings)))}]",
            "",
        ]
    )
