"""Tables in TDMS files, as LabVIEW and loggers of National Instruments write them.

Needs nptdms, the extra ``tdms`` (its licence is the LGPL, so it is never installed unasked).
"""

import logging
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.errors import DataError, RequestError, did_you_mean, needing
from seakeep.formats.columns import WHICH, Columns, Options, decoding

LEAD_IN = 28
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit", "units")


def read_tdms(path: Path, options: Options) -> Columns:
    """Read the channels of one group of a TDMS file, scaled as the file says.

    A column ``time`` (s) comes from the waveform properties ``wf_start_offset`` and
    ``wf_increment``. Instants (channels of time stamps) are seconds after their first. `group` may
    be left out where one group has channels, or all are sampled alike.
    """
    with needing(f"{path} is a TDMS file; reading it", "tdms"):
        import nptdms

    logging.getLogger("nptdms").setLevel(logging.ERROR)  # the error says what is wrong
    # Opened here, since nptdms leaves a file open whose head it cannot read.
    with (
        decoding(
            path,
            "a TDMS file: cut off or damaged",
            "Copy it again, or export it from LabVIEW or DIAdem.",
        ),
        path.open("rb") as raw,
    ):
        _check_whole(raw)
        with nptdms.TdmsFile.open(raw) as file:
            channels = [
                channel
                for channel in _chosen(path, file, options.group)
                if len(channel) > 1 and np.dtype(channel.dtype or object).kind in "fiubM"
            ]
            data = [channel[:] for channel in channels]
    if not channels:
        raise DataError(
            f"{path} holds no channels of numbers with at least two samples. Export the run again."
        )
    if len({values.size for values in data}) > 1:
        listed = ", ".join(f"{each.name} {len(each)}" for each in channels)
        raise DataError(
            f"{path}: the channels differ in length ({listed}). Put channels of one clock into one "
            "group, and state it with group = 'NAME' in [files]."
        )
    bare = Counter(channel.name for channel in channels)
    names = [
        channel.name if bare[channel.name] == 1 else f"{channel.group_name}/{channel.name}"
        for channel in channels
    ]
    values, units = {}, {}
    for name, channel, numbers in zip(names, channels, data, strict=True):
        if numbers.dtype.kind == "M":
            after = numbers - numbers[0]  # NaN where one is missing
            values[name], units[name] = after / np.timedelta64(1, "ns") * 1e-9, "s"
            continue
        values[name] = numbers.astype(float)
        stated = (channel.properties[key] for key in _UNITS if key in channel.properties)
        if unit := str(next(stated, "")).strip():
            units[name] = unit
    time = _waveform_time(path, channels, data[0].size)
    if time is not None and not any(name.lower() == "time" for name in names):
        values = {"time": time, **values}
        units["time"] = "s"
    return Columns(values, units)


def _check_whole(raw: BinaryIO) -> None:
    """Refuse a file whose segments do not end where it ends.

    Each segment starts with 28 bytes: ``TDSm``, two numbers of four bytes, and the lengths of what
    follows. nptdms leaves an incomplete last segment out, with a line in a log.
    """
    size, at = raw.seek(0, os.SEEK_END), 0
    while at < size:
        raw.seek(at)
        head = raw.read(LEAD_IN)
        if len(head) < LEAD_IN or head[:4] != b"TDSm":
            raise ValueError(f"no segment starts at byte {at}")
        at += LEAD_IN + int.from_bytes(head[12:20], "little")
    if at > size:
        raise ValueError(f"its last segment is not complete, the file ends at byte {size}")
    raw.seek(0)


def _chosen(path: Path, file: Any, wanted: str | None) -> Sequence[Any]:
    groups = {group.name: group.channels() for group in file.groups()}
    if wanted is not None:
        if wanted not in groups:
            raise RequestError(
                f"{path} has no group '{wanted}'.{did_you_mean(wanted, groups)} Its groups: "
                f"{', '.join(groups) or 'none'}. Correct 'group' in [files]."
            )
        return groups[wanted]
    filled = {name: channels for name, channels in groups.items() if channels}
    every = [channel for channels in filled.values() for channel in channels]
    sampled = {(len(channel), channel.properties.get("wf_increment")) for channel in every}
    if len(filled) > 1 and len(sampled) > 1:
        listed = ", ".join(
            f"'{name}' ({len(channels)} channels of {len(channels[0])})"
            for name, channels in filled.items()
        )
        raise RequestError(
            f"{path} holds several groups that are sampled differently: {listed}. {WHICH}"
        )
    return every


def _waveform_time(path: Path, channels: list[Any], count: int) -> FloatArray | None:
    axes = {
        channel.name: (
            float(channel.properties["wf_increment"]),
            float(channel.properties.get("wf_start_offset", 0.0)),
        )
        for channel in channels
        if float(channel.properties.get("wf_increment", 0.0)) > 0
    }
    if not axes:
        return None
    if len(set(axes.values())) > 1:
        listed = ", ".join(f"{name} {step:g} s from {first:g} s" for name, (step, first)
                           in axes.items())  # fmt: skip
        raise DataError(
            f"{path}: the channels are sampled differently ({listed}). Put channels of one clock "
            "into one group, and state it with group = 'NAME' in [files]."
        )
    step, first = next(iter(axes.values()))
    return first + step * np.arange(count, dtype=float)
