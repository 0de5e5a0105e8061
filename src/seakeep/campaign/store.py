"""Prepared runs on disk: one NetCDF file a run, used again while it is fresh."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from seakeep.campaign.prepare import Campaign, Progress, version
from seakeep.errors import SeakeepWarning

__all__ = ["load_prepared", "write_prepared"]


def write_prepared(
    campaign: Campaign,
    out_dir: Path | str | None = None,
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
) -> dict[str, Path]:
    """Prepare runs and write each to a NetCDF file.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    out_dir : Path or str, optional
        Folder for the files; the default is ``prepared`` beside the campaign file.
    names, progress
        As in :meth:`Campaign.prepare`.

    Returns
    -------
    dict of str to Path
        File of each run: ``NAME.nc``, written to a temporary name and renamed.

    Raises
    ------
    RequestError, DataError
        As :meth:`Campaign.prepare`.
    """
    folder = _folder(campaign, out_dir)
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    for name, run in campaign.prepare(names, progress).items():
        files[name] = folder / f"{name}.nc"
        temporary = folder / f".{name}.{os.getpid()}.tmp"
        try:
            run.to_netcdf(temporary, engine="h5netcdf")
            temporary.replace(files[name])
        finally:
            temporary.unlink(missing_ok=True)
    return files


def load_prepared(
    campaign: Campaign,
    out_dir: Path | str | None = None,
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
) -> dict[str, xr.Dataset]:
    """Take prepared runs from their files where these are fresh, else prepare them in memory.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    out_dir : Path or str, optional
        Folder of the files; the default is ``prepared`` beside the campaign file.
    names, progress
        As in :meth:`Campaign.prepare`.

    Returns
    -------
    dict of str to xarray.Dataset
        As :meth:`Campaign.prepare` gives them. A file is fresh if the campaign's digest, the
        checksum of the raw file and the version of seakeep are those it was written with.

    Raises
    ------
    RequestError, DataError
        As :meth:`Campaign.prepare`.
    """
    folder = _folder(campaign, out_dir)
    wanted = list(campaign.runs if names is None else names)
    fresh = {name: _fresh(campaign, name, folder / f"{name}.nc") for name in wanted}
    missing = [name for name, run in fresh.items() if run is None]
    made = campaign.prepare(missing, progress) if missing else {}
    steps = {run.attrs["dt"] for run in (*made.values(), *fresh.values()) if run is not None}
    if len(steps) > 1:  # files of one rate beside runs of another: only the whole tells
        made = campaign.prepare(wanted, progress)
    found = {name: run for name, run in fresh.items() if run is not None}
    return {name: made[name] if name in made else found[name] for name in wanted}


def _folder(campaign: Campaign, out_dir: Path | str | None) -> Path:
    return campaign.path.parent / "prepared" if out_dir is None else Path(out_dir)


def _fresh(campaign: Campaign, name: str, file: Path) -> xr.Dataset | None:
    if not file.exists():
        return None
    try:
        with xr.open_dataset(file, engine="h5netcdf", decode_times=False) as opened:
            run = opened.load()
    except (OSError, ValueError, KeyError, RuntimeError):
        warnings.warn(
            f"{file} cannot be read; the run is prepared anew. Write it again with 'seakeep "
            "prepare'.",
            SeakeepWarning,
            stacklevel=3,
        )
        return None
    expected: Mapping[str, object] = {
        "campaign_digest": campaign.digest,
        "file_sha256": campaign.checksum_of(name),
        "seakeep_version": version(),
        "campaign": campaign.name,
    }
    if any(run.attrs.get(key) != value for key, value in expected.items()):
        return None
    run.attrs = {key: _plain(value) for key, value in run.attrs.items()}
    for each in run.variables.values():
        each.attrs = {k: _plain(v) for k, v in each.attrs.items() if k != "_FillValue"}
        each.encoding = {}
    run.encoding = {}
    return run


def _plain(value: Any) -> Any:
    """Turn an attribute, as NetCDF gives it, into what was written."""
    if isinstance(value, np.ndarray):
        return tuple(float(each) for each in value)
    return value.item() if isinstance(value, np.generic) else value
