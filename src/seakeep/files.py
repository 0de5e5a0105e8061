"""Reading of regular files, and writing of files that appear whole or not at all."""

from __future__ import annotations

import difflib
import functools
import hashlib
import io
import json
import re
import secrets
import shutil
import stat
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seakeep.errors import DataError, MissingFileError, RequestError, did_you_mean

if TYPE_CHECKING:
    import xarray as xr
    from jinja2 import Environment

    from seakeep.arrays import Datasets, Groups

FORMAT = 16
"""Format of sealed files; one of another format is refused, and made again."""
MARK = "seakeep_file"
"""Attribute of a NetCDF file of ours, and word somewhere in a text or picture: ``KIND``."""
SEAL = b"seakeep CRC-32 "
"""Marker between the content of a NetCDF file and its checksum; HDF5 reads no further. A SHA-256
would take half of the time of reading a large result."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
CONTENTS = "seakeep_contents"
"""Attribute that lists groups, variables, dimensions and attributes: HDF5 takes ten times as long
to find them."""
SHOWN = 5
"""Names of a folder that a message lists at most."""


def is_there(path: Path) -> bool:
    """Whether there is a file, a folder or another thing at a path.

    Raises
    ------
    MissingFileError
        If the system refuses to look at it, as at names that are too long.
    """
    try:
        return path.exists()
    except OSError as error:
        raise _unreadable(path, error) from None


@contextmanager
def reading(path: Path | str) -> Iterator[Path]:
    """Check that a file can be read, and report every fault of the system as one error.

    Parameters
    ----------
    path : Path or str
        What the user named.

    Yields
    ------
    Path
        The path of a regular file.

    Raises
    ------
    MissingFileError
        If there is no such file, it is a folder, a pipe, a socket or a device, or the system
        refuses to look at it or fails while it is read.
    """
    place = expanded(path)
    try:
        if not place.exists():
            raise _missing(place)
        if not place.is_file():
            what = "a folder" if place.is_dir() else "a pipe or a device"
            raise MissingFileError(
                f"{path} is {what}, and only regular files are read. Give a file."
            )
        yield place
    except OSError as error:
        raise _unreadable(path, error) from error


def read_bytes(path: Path | str) -> bytes:
    """Content of a regular file; raises as :func:`reading`."""
    with reading(path) as place:
        return place.read_bytes()


def digest_of(content: object) -> str:
    """SHA-256 of JSON values, in hexadecimal digits, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal digits.

    Parameters
    ----------
    path : Path
        The file; it is read in pieces, and once as long as size and times stay the same.

    Returns
    -------
    str
        The checksum.

    Raises
    ------
    MissingFileError
        As :func:`reading`.
    """
    with reading(path) as place:
        state = place.stat()
        return _sum(place, state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns)


@functools.cache
def _sum(path: Path, *state: int) -> str:
    """Checksum of a file in a state."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def expanded(path: str | Path) -> Path:
    """Path with the home folder in place of ``~``.

    Parameters
    ----------
    path : str or Path
        As the user gave it.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    MissingFileError
        If no home is known of the user that ``~`` names.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path | str, error: Exception) -> MissingFileError:
    mend = "Correct the path."
    if isinstance(error, PermissionError):
        mend = "Change its permissions, or copy it to a place that you may read."
    return MissingFileError(f"{path} cannot be read: {_reason(error)}. {mend}")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _missing(path: Path) -> MissingFileError:
    try:
        beside = sorted(each.name for each in path.parent.iterdir())
    except OSError:
        return MissingFileError(
            f"{path} does not exist: there is no folder {path.parent}. Correct the path."
        )
    near = did_you_mean(path.name, beside)
    beside.sort(key=lambda name: -difflib.SequenceMatcher(None, path.name, name).ratio())
    listed = ", ".join(sorted(beside[:SHOWN])) or "nothing"
    if len(beside) > SHOWN:
        listed = f"{len(beside)} names, the nearest of them {listed}"
    return MissingFileError(
        f"{path} does not exist.{near} Its folder holds {listed}. Correct the name."
    )


@functools.cache
def templates(room: str) -> Environment:
    """Templates of a room; what they name must be given, and is escaped in HTML."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    return Environment(
        loader=PackageLoader(f"seakeep.{room}"),
        autoescape=select_autoescape(),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name next to `path`, renamed to `path` on success.

    Parameters
    ----------
    path : Path
        The file wanted.

    Yields
    ------
    Path
        An empty file in the same folder, to be overwritten. It has the permissions of the file that
        it replaces, or those that the umask gives to a new one.

    Raises
    ------
    RequestError
        If the folder does not exist or cannot be written, or the disk is full. What was at `path`
        before stays as it was.
    """
    check_place(path)
    try:
        target = path.resolve()  # a link stays one
        # Opened and not made by tempfile, so that the file gets the permissions the user's umask
        # gives to any other.
        temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
        temporary.open("xb").close()
        try:
            if target.exists():
                temporary.chmod(stat.S_IMODE(target.stat().st_mode) | stat.S_IWUSR)
            yield temporary
            if target.exists():
                shutil.copymode(target, temporary)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        mend = "Free space on the disk or choose another place."
        if isinstance(error, PermissionError):
            mend = "Choose a folder that you may write to, or change its permissions."
        raise RequestError(
            f"cannot write {path}: {error.strerror or error}. The file that was there before, if "
            f"any, is untouched. {mend}"
        ) from error


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, its ends of lines as they are; raises as :func:`replacing`."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")


def write_netcdf(path: Path, dataset: xr.Dataset, groups: Datasets | None = None) -> None:
    """Write a NetCDF file with a checksum at its end, which :func:`read_sealed` compares.

    HDF5 does not survive a write that fails: it raises errors of many kinds, keeps the file open,
    and takes the process with it at its end. The file is therefore made in memory first. h5netcdf
    would take a hundred times as long for many groups, and measured numbers compress by a quarter
    at five times the cost.

    Parameters
    ----------
    path : Path
        The file.
    dataset : Dataset
        What goes into its root.
    groups : mapping of str to Dataset, optional
        What goes into groups.

    Raises
    ------
    RequestError
        As :func:`replacing`.
    """
    # Here, so that commands that write no such file start without HDF5.
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("v108", "v108"), track_order=True) as file:
        parts = {"": dataset, **(groups or {})}
        for name, part in parts.items():
            _write_group(file.create_group(name, track_order=True) if name else file, part)
        # Attributes, coordinates, and dimensions, attributes and kind of each variable.
        contents = {
            name: [
                part.attrs,
                [*part.coords],
                {key: (v.dims, v.attrs, v.dtype.kind) for key, v in part.variables.items()},
            ]
            for name, part in parts.items()
        }
        file.attrs[CONTENTS] = json.dumps(contents, default=lambda value: value.tolist())
    with replacing(path) as temporary, temporary.open("wb") as file, buffer.getbuffer() as content:
        file.writelines([content, _seal_of(content)])


def _write_group(place: Any, data: xr.Dataset) -> None:
    """Write a Dataset as NetCDF-4: its dimensions are scales of HDF5."""
    import h5py

    place.attrs.update(data.attrs)
    if others := [str(name) for name in data.coords if name not in data.dims]:
        place.attrs["coordinates"] = " ".join(others)
    stored = {}  # what is opened by its name again takes HDF5 as long as to write it
    for dim in (each for each in data.sizes if each not in data.variables):
        stored[dim] = place.create_dataset(dim, (data.sizes[dim],), ">f4")
        stored[dim].make_scale(NO_VARIABLE)
    for key, each in data.variables.items():
        kind = each.dtype.kind
        how = {"dtype": h5py.string_dtype()} if kind in "OU" else {}
        values = each.values.astype({"b": "i1", "U": "O"}.get(kind, each.dtype), copy=False)
        stored[key] = place.create_dataset(key, data=values, **how)
        stored[key].attrs.update(each.attrs | ({"dtype": "bool"} if kind == "b" else {}))
        if each.dims == (key,):
            stored[key].make_scale(key)
    for key, each in data.variables.items():
        for number, dim in enumerate(each.dims if each.dims != (key,) else ()):
            h5py.h5ds.attach_scale(stored[key].id, stored[dim].id, number)


def _read_group(place: Any, contents: list[Any]) -> xr.Dataset:
    """Read what :func:`_write_group` wrote; an attribute of several values becomes a tuple."""
    import xarray as xr

    def plain(attrs: dict[str, Any]) -> dict[str, Any]:
        return {key: tuple(v) if isinstance(v, list) else v for key, v in attrs.items()}

    attrs, coords, variables = contents
    read = {}
    for key, (dims, own, kind) in variables.items():
        values = (place[key].asstr() if kind in "OU" else place[key])[()]
        read[key] = dims, values.astype(bool) if kind == "b" else values, plain(own)
    return xr.Dataset(read, attrs=plain(attrs)).set_coords(coords)


def _seal_of(content: memoryview) -> bytes:
    return SEAL + b"%08x" % zlib.crc32(content)


def read_sealed(path: Path | str) -> io.BytesIO:
    """Content of a file of :func:`write_netcdf`, once its checksum was compared.

    HDF5 does not survive all damage: a flipped byte may bring it to a crash, or to a loop that
    Ctrl-C does not end. It must therefore read nothing but what was written.

    Parameters
    ----------
    path : Path or str
        The file.

    Returns
    -------
    BytesIO
        A NetCDF file in memory.

    Raises
    ------
    MissingFileError
        If there is no such file, or it cannot be read.
    DataError
        If its checksum is missing or another one.
    """
    file = read_bytes(path)
    size = len(SEAL) + 8
    content, stated = memoryview(file)[:-size], file[-size:]
    if file and not file.startswith((b"\x89HDF", b"CDF")):
        raise DataError(
            f"{path} is no NetCDF file, as seakeep writes. Name one that it wrote, such as "
            "model.nc of seakeep fit; runs are described by a campaign file."
        )
    if stated != _seal_of(content):
        sealed = stated.startswith(SEAL)
        why = "its checksum is another one" if sealed else "it has no checksum at its end"
        raise DataError(
            f"{path} was cut off, altered or damaged, or seakeep did not write it: {why}. Copy it "
            "again, or remove it and make it anew."
        )
    return io.BytesIO(file)


def write_sealed(
    dataset: xr.Dataset,
    path: Path | str,
    kind: str,
) -> Path:
    """Write a file of ours: NetCDF with its kind, its format and a checksum.

    Parameters
    ----------
    dataset : Dataset
        What goes into it.
    path : Path or str
        The file; an earlier one of the same kind is replaced.
    kind : str
        What it is, such as ``"model"``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If it cannot be written, or a file of another kind is there.
    """
    target = Path(path)
    check_output(target, kind)
    write_netcdf(target, dataset.assign_attrs(head_of(kind)))
    return target


def head_of(kind: str) -> dict[str, Any]:
    """Attributes of a file of ours: its kind, its format and what wrote it."""
    return {MARK: kind, "seakeep_format": FORMAT, "seakeep_version": version()}


@functools.cache
def version() -> str:
    """Version of seakeep."""
    return metadata.version("seakeep")


def load_sealed(path: Path | str, kind: str) -> xr.Dataset:
    """Read the root of a file as :func:`load_groups` does."""
    return load_groups(path, kind)[""]


def load_groups(path: Path | str, kind: str) -> Groups:
    """Read a file of ours into memory.

    What it holds is trusted: its checksum fits, and this version knows its format.

    Parameters
    ----------
    path : Path or str
        The file.
    kind : str
        What it must be.

    Returns
    -------
    dict of str to Dataset
        What was written: its groups by name, and its root under the empty name.

    Raises
    ------
    MissingFileError
        If there is no such file, or it cannot be read.
    DataError
        If it is damaged, of another kind, or of another format.
    """
    import h5py

    with h5py.File(read_sealed(path)) as file:
        head = dict(file.attrs)
        if (mark := head.get(MARK)) != kind:
            raise DataError(
                f"{path} holds a {mark or 'table'}, and a {kind} is expected here. Name another "
                "file."
            )
        if (number := head.get("seakeep_format")) != FORMAT:
            raise DataError(
                f"{path} has format {number}, written by seakeep "
                f"{head.get('seakeep_version', '?')}, and this seakeep reads format {FORMAT}. "
                "Make the file again with this version, or update seakeep."
            )
        out = {
            name: _read_group(file[name or "/"], contents)
            for name, contents in json.loads(head[CONTENTS]).items()
        }
    for key in (MARK, "seakeep_format"):
        del out[""].attrs[key]
    return out


def check_place(path: Path, suffix: str | None = None) -> None:
    """Refuse a path that cannot be written, before the work starts.

    Parameters
    ----------
    path : Path
        The file wanted.
    suffix : str, optional
        What its name must end with, where only one kind of file is written.

    Raises
    ------
    RequestError
        If it is a folder or a device, its own folder does not exist, or its name says another kind.
    """
    if is_there(path) and not path.is_file():
        what = "a folder" if path.is_dir() else "a pipe or a device"
        raise RequestError(f"cannot write {path}: it is {what}. Name a file.")
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
        NetCDF files state it in the attribute :data:`MARK`; others as ``seakeep_file: KIND``.
    inputs : iterable of Path
        Files that the command reads.
    header : str, optional
        Pattern of the first two lines of a CSV file, which has no place for a mark.

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
    with path.open("rb") as file:
        start = file.read(len(HDF5))
        if path.suffix == ".nc" or start == HDF5:
            ours = _mark_of_netcdf(path) == kind
        elif path.suffix == ".csv":
            lines = start + file.readline() + file.readline()
            ours = bool(header and re.match(header, lines.decode("utf-8", "replace")))
        else:
            ours = f"{MARK}: {kind}".encode() in start + file.read()
    if not ours:
        raise RequestError(
            f"{path} exists and is not a {kind} that seakeep wrote; it may be a measurement. "
            "Choose another name, or remove it first."
        )


def check_report(folder: Path) -> None:
    """Refuse, before any work, a folder in which a report would replace what none has written.

    Parameters
    ----------
    folder : Path
        Folder for ``report.html``, ``figures/``, ``tables/`` and ``histories/``.

    Raises
    ------
    RequestError
        If it holds a page of others, or no page and files in one of these folders.
    """
    page = folder / "report.html"
    check_output(page, "report")
    for each in () if is_there(page) else ("figures", "tables", "histories"):
        if any(folder.glob(f"{each}/*")):
            raise RequestError(
                f"{folder / each} holds files that no report of seakeep wrote; those of the report "
                "would stand among them. Choose another folder (-o)."
            )


HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of a NetCDF file, for any suffix."""


def _mark_of_netcdf(path: Path) -> str | None:
    import h5py  # a tenth of the time of h5netcdf

    try:
        with h5py.File(read_sealed(path)) as file:
            return str(file.attrs.get(MARK))
    except (DataError, OSError):  # not ours
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
    except (OSError, ValueError) as error:
        raise RequestError(
            f"cannot make the folder {path}: {_reason(error)}. Choose another place."
        ) from error
    return path
