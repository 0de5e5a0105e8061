"""Raw files of the virtual tank: CSV or NetCDF, written to a temporary name and renamed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.files import replacing, write_netcdf
from seakeep.tank.instruments import Record

__all__ = ["header", "time_decimals", "write_dataset", "write_record", "write_text"]

ROWS_AT_ONCE = 20_000


def header(name: str, unit: str) -> str:
    """Head of a column: its name with the unit in brackets.

    Examples
    --------
    >>> header("kn_fwd", "mm"), header("lamp", "-")
    ('kn_fwd [mm]', 'lamp [-]')
    """
    return f"{name} [{unit}]"


def time_decimals(record: Record) -> int:
    """Decimals that hold the clock's readings: as many as needed up to six."""
    for decimals in range(1, 6):
        if np.allclose(np.round(record.time[:4], decimals), record.time[:4], atol=1e-9):
            return decimals
    return 6


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then rename it."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _csv(record: Record) -> str:
    heads = [header("time", "s")]
    heads += [header(name, column.unit) for name, column in record.columns.items()]
    decimals = [time_decimals(record)] + [c.decimals for c in record.columns.values()]
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
    """Write one logger's record.

    Parameters
    ----------
    record : Record
        The record.
    folder : Path
        Where to; it exists.
    kind : {"csv", "nc"}
        Format. A sample that an instrument lost is an empty field in CSV, NaN in NetCDF.

    Returns
    -------
    Path
        The file.
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
    )
    write_dataset(data, path)
    return path


def write_dataset(data: xr.Dataset, path: Path) -> None:
    """Write a Dataset to NetCDF, compressed, under a temporary name, then rename it."""
    with replacing(path) as temporary:
        write_netcdf(temporary, data, packing=_packing)


def _packing(data: xr.Dataset) -> dict[str, dict[str, object]]:
    return {str(name): {"zlib": True, "complevel": 4} for name in data.data_vars}
