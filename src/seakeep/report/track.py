"""What ``seakeep track`` writes and says: a track as a Dataset, as files, and in words."""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.conventions import conversion, displayed
from seakeep.files import MARK, replacing, write_netcdf, write_text
from seakeep.signals import MotionAgreement, Track, compare_motion
from seakeep.signals.tracking import FLAGS, LABELS

TRACK, CONTACT_SHEET = "track", "contact sheet"
"""Kinds of files, as their marks say it."""
HEADER = r"time \[s\],surge \[m\],heave \[m\],pitch \[deg\],centroid_x \[pixel\],"
"""Pattern of the first line of a track in CSV."""
DECIMALS = {"s": 6, "m": 6, "deg": 5, "pixel": 3, "pixel^2": 1, "1": 4}


def track_text(track: Track) -> str:
    """CSV with units in brackets; angles in degrees, as loggers write them; NaN is empty."""
    columns = {}
    for name, values in {"time": track.time, **track.channels}.items():
        factor, unit = displayed("s" if name == "time" else LABELS[name]["units"])
        numbers = np.asarray(values)
        if np.issubdtype(numbers.dtype, np.floating):
            numbers = np.round(factor * numbers, DECIMALS[unit]) + 0.0
        columns[f"{name} [{'-' if unit == '1' else unit}]"] = numbers
    return pd.DataFrame(columns).to_csv(index=False, lineterminator="\n")


def write_track(track: Track, path: Path) -> None:
    """Write a track by the suffix of its file: NetCDF in SI units, or :func:`track_text`."""
    if path.suffix != ".nc":
        write_text(path, track_text(track))
        return
    data = {name: ("time", values, LABELS[name]) for name, values in track.channels.items()}
    time = ("time", track.time, {"units": "s", "long_name": "time"})
    out = xr.Dataset(data, {"time": time}, {**track.attributes, MARK: TRACK})
    out["flag"].attrs |= {"flag_values": list(FLAGS.values()), "flag_meanings": " ".join(FLAGS)}
    write_netcdf(path, out)


def write_contact_sheet(picture: bytes, path: Path) -> None:
    """Write a PNG with a comment, before its last chunk of twelve bytes, that says what it is."""
    text = b"tEXtComment\0" + f"{MARK}: {CONTACT_SHEET}".encode("ascii")
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    with replacing(path) as temporary:
        temporary.write_bytes(picture[:-12] + chunk + picture[-12:])


def track_words(track: Track) -> str:
    """Frames, flags and calibration of a track in one sentence."""
    counts = {name: (track["flag"] == code).sum() for name, code in FLAGS.items()}
    flagged = [f"{count} {name}" for name, count in counts.items() if count and name != "good"]
    facts = track.attributes
    return (
        f"{track.time.size} frames at {facts['frame_rate']:g} Hz; flagged: "
        f"{', '.join(flagged) or 'none'} ({track['bridged'].sum()} bridged); "
        f"{1e3 * facts['metres_per_pixel']:.4g} mm per pixel ({facts['calibration']}); "
        f"{facts['camera']}."
    )


def agreement_words(
    track: Track, reference: xr.Dataset, max_lag: float | None
) -> Iterator[tuple[str, str | None]]:
    """Agreement of heave and pitch with a reference; in yellow, why its lag may be wrong."""
    for name in ("heave", "pitch"):
        other, unit = reference[name], LABELS[name]["units"]
        factor = conversion(other.attrs.get("units", unit), unit, f"'{name}'")
        time = reference["time"].values
        agreement = compare_motion(track[name], track.time, factor * other.values, time, max_lag)
        shown, unit = (1e3, "mm") if unit == "m" else displayed(unit)
        yield (
            (
                f"{name} against the MRU: correlation {agreement.correlation:.4f}, video late by "
                f"{agreement.lag:+.3f} s, RMS difference {shown * agreement.rms:.3g} {unit}, "
                f"{agreement.samples} samples"
            ),
            None,
        )
        if doubt := _doubt(agreement):
            yield f"Note: {name}: {doubt}", "yellow"


def _doubt(agreement: MotionAgreement) -> str:
    """Why the lag may be wrong; empty if there is no reason."""
    searched = f"the lags searched (within {agreement.max_lag:g} s)"
    if agreement.at_limit:
        return f"the lag is at the end of {searched}; the true one may be longer. Raise --max-lag."
    if agreement.ambiguous:
        return (
            f"at {agreement.rival_lag:+.3f} s the correlation is "
            f"{agreement.rival_correlation:.4f}, nearly as high: the lag is known only up to "
            "whole wave periods. Let a trigger that both recorded decide (--lamp), or take an "
            "irregular run."
        )
    if not agreement.enclosed:
        return (
            f"{searched} do not reach a wave period ({agreement.period:.3g} s) beyond this one, "
            "where the two may fit better. Raise --max-lag."
        )
    return ""
