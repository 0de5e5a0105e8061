"""Files that are either written whole or not at all."""

from __future__ import annotations

import errno
import io
import os
import re
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seakeep.errors import RequestError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MARK", "check_output", "check_place", "make_folder", "replacing", "write_netcdf"]

MARK = "seakeep_file"
"""Attribute of a NetCDF file of ours, and word near the start of a text or picture: ``KIND``."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`, renamed onto it when all went well.

    Parameters
    ----------
    path : Path
        The file wanted.

    Yields
    ------
    Path
        An empty file in the same folder, to be overwritten.

    Raises
    ------
    RequestError
        If the folder does not exist or cannot be written, or the disk is full. What was at `path`
        before stays as it was.
    """
    check_place(path)
    try:
        # Opened and not made by tempfile, so that the file gets the permissions the user's umask
        # gives to any other.
        temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
        temporary.open("xb").close()
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        mend = "Free space on the disk or choose another place."
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
            mend = "Choose a folder that you may write to, or change its permissions."
        raise RequestError(
            f"cannot write {path}: {error.strerror or error}. The file that was there before, if "
            f"any, is untouched. {mend}"
        ) from error


def write_netcdf(
    path: Path,
    dataset: xr.Dataset,
    groups: Mapping[str, xr.Dataset] | None = None,
    packing: Callable[[xr.Dataset], Mapping[Any, Mapping[str, Any]]] | None = None,
    onto: Path | None = None,
) -> None:
    """Write a NetCDF file; a disk that is full is told as by any other write.

    HDF5 does not survive a write that fails: it raises errors of many kinds, keeps the file open,
    and takes the process with it at its end. The file is therefore made in memory first.

    Parameters
    ----------
    path : Path
        The file, such as :func:`replacing` gives it; overwritten.
    dataset : Dataset
        What goes into the root of the file.
    groups : mapping of str to Dataset, optional
        What goes into groups, by their names.
    packing : callable, optional
        Gives the encoding of the variables of a Dataset, such as their compression.
    onto : Path, optional
        A NetCDF file whose content is taken over, and added to.

    Raises
    ------
    OSError
        If a file cannot be read or written; :func:`replacing` tells it in words.
    """
    # Here, so that commands that write no such file start without HDF5.
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    made = io.BytesIO(b"" if onto is None else onto.read_bytes())
    parts = [(None, dataset), *(groups or {}).items()]
    with h5netcdf.File(made, "w" if onto is None else "r+") as file:
        for name, each in parts:
            encoding = {} if packing is None else packing(each)
            each.dump_to_store(H5NetCDFStore(file, group=name, mode="a"), encoding=encoding)
    path.write_bytes(made.getvalue())  # shares the memory, and survives what was written into it


def check_place(path: Path, suffix: str | None = None) -> None:
    """Refuse a path at which no file can be written, before the work and not after it.

    Parameters
    ----------
    path : Path
        The file wanted.
    suffix : str, optional
        What its name must end with, where only one kind of file is written.

    Raises
    ------
    RequestError
        If it is a folder, its own folder does not exist, or its name says another kind.
    """
    if path.is_dir():
        raise RequestError(
            f"cannot write {path}: it is a folder. Name a file in it, such as {path / 'model.nc'}."
        )
    if path.parent.exists() and not path.parent.is_dir():
        raise RequestError(
            f"cannot write {path}: {path.parent} is a file, not a folder. Choose another place."
        )
    if not path.parent.is_dir():
        raise RequestError(
            f"cannot write {path}: the folder {path.parent} does not exist. Create it first."
        )
    if suffix is not None and path.suffix != suffix:
        raise RequestError(
            f"{path} ends in '{path.suffix}', and a file of the kind {suffix} is written. Name it "
            f"{path.with_suffix(suffix)}."
        )


def check_output(
    path: Path, kind: str, inputs: Iterable[Path] = (), header: str | None = None
) -> None:
    """Refuse, before any work, to replace an input or a file that seakeep did not write.

    Parameters
    ----------
    path : Path
        The file wanted.
    kind : str
        What is written there, such as ``"model"``: a file at `path` must be of the same kind.
        NetCDF files state it in the attribute :data:`MARK`; others as ``seakeep_file: KIND`` in
        their first or last kilobytes.
    inputs : iterable of Path
        Files that the command reads.
    header : str, optional
        Pattern of the first line of a CSV file, which has no place for a mark.

    Raises
    ------
    RequestError
        If nothing can be written there, or something would be lost.
    """
    check_place(path)
    if not path.exists():
        return
    if any(each.exists() and path.samefile(each) for each in inputs):
        raise RequestError(
            f"{path} is read by this command and would be overwritten by the {kind}. "
            "Choose another name."
        )
    if path.suffix == ".nc":
        ours = _mark_of_netcdf(path) == kind
    else:
        with path.open("rb") as file:
            start = file.read(HEAD).decode("utf-8", "replace")
            file.seek(-min(HEAD, path.stat().st_size), os.SEEK_END)
            end = file.read().decode("utf-8", "replace")  # where PDF keeps it
        if path.suffix == ".csv":
            ours = header is not None and re.fullmatch(header, start.partition("\n")[0]) is not None
        else:
            ours = f"{MARK}: {kind}" in start + end
    if not ours:
        raise RequestError(
            f"{path} exists and is no {kind} that seakeep wrote; it may be a measurement. Choose "
            "another name, or remove it first."
        )


HEAD = 8192
"""Bytes of a file in which its mark is looked for."""


def _mark_of_netcdf(path: Path) -> str | None:
    import h5netcdf

    try:
        with h5netcdf.File(path, "r") as file:
            return str(file.attrs.get(MARK))
    except OSError:  # a NetCDF 3 file, or none: not ours
        return None


def make_folder(path: Path) -> Path:
    """Make a folder and those above it, if they do not exist.

    Parameters
    ----------
    path : Path
        The folder wanted.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    RequestError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError(
            f"cannot make the folder {path}: {error.strerror or error}. Choose another place."
        ) from error
    return path
