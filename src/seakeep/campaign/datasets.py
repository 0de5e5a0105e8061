"""Public data sets of the examples: origin, licence, checksums; fetched only on request."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from seakeep.arrays import Progress
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.files import expanded, make_folder, sha256_of
from seakeep.toml import packaged

TIMEOUT = 60.0
"""Seconds without an answer after which a download is given up."""


@dataclass(frozen=True)
class PublicDataset:
    """A public data set that an example uses.

    Parameters
    ----------
    name : str
        Folder below the data folder.
    title, origin, licence, reference : str
        What it is, where it comes from, under which terms, and who to cite.
    files : mapping of str to str
        SHA-256 by file name.
    sources : sequence of str
        Addresses of the folder of the files, tried in this order; empty where the data set is
        not fetched.
    note : str
        Why it is not fetched, or what to know.
    """

    name: str
    title: str
    origin: str
    licence: str
    reference: str
    files: Mapping[str, str]
    sources: Sequence[str] = ()
    note: str = ""


DATASETS = [PublicDataset(n, **facts) for n, facts in packaged("campaign/datasets.toml").items()]


def find_dataset(name: str) -> PublicDataset:
    """Data set of a name; a RequestError where there is none."""
    known = {dataset.name: dataset for dataset in DATASETS}
    if name not in known:
        raise RequestError(
            f"there is no data set '{name}'.{did_you_mean(name, known)} Known: {', '.join(known)}."
        )
    return known[name]


def data_folder() -> Path | None:
    """Folder named by ``SEAKEEP_DATA_DIR``, or None where it is not set."""
    named = os.environ.get("SEAKEEP_DATA_DIR")
    return expanded(named) if named else None


def state_of(dataset: PublicDataset, folder: Path | None) -> str:
    """Say how much of a data set is in a folder, by checksum: complete, absent, or how many."""
    if not folder:
        return "unknown: SEAKEEP_DATA_DIR is not set"
    places = {folder / dataset.name / name: wanted for name, wanted in dataset.files.items()}
    right = [sha256_of(place) == places[place] for place in places if place.is_file()]
    if not right:
        return "absent"
    if len(right) == len(places) and all(right):
        return "complete"
    return (
        f"{right.count(True)} of {len(places)} files as published, {len(places) - len(right)} "
        f"missing, {right.count(False)} altered"
    )


def fetch(dataset: PublicDataset, folder: Path, progress: Progress | None = None) -> Path:
    """Download what is missing of a data set and check it.

    Parameters
    ----------
    dataset : PublicDataset
        The data set.
    folder : Path
        The data folder; made if it does not exist.
    progress : callable, optional
        Called as ``progress(done, total, name)`` after each file.

    Returns
    -------
    Path
        The folder of the data set. Files whose checksum is right are not fetched again.

    Raises
    ------
    RequestError
        If the data set is not fetched, or no address answers.
    DataError
        If what was received is not the published file.
    """
    if not dataset.sources:
        raise RequestError(f"'{dataset.name}' cannot be fetched; {dataset.note}.")
    target = make_folder(folder / dataset.name)
    for done, (name, wanted) in enumerate(dataset.files.items(), 1):
        _fetch_file(name, wanted, target, dataset.sources)
        if progress:
            progress(done, len(dataset.files), name)
    return target


def _fetch_file(name: str, wanted: str, target: Path, addresses: Sequence[str]) -> None:
    """Fetch a file from the first address that has it whole; it is written once it is checked."""
    import pooch

    pooch.get_logger().setLevel("ERROR")
    failures, altered = [], False
    for address in addresses:
        try:
            pooch.retrieve(
                f"{address}/{name}",
                known_hash=f"sha256:{wanted}",
                fname=name,
                path=target,
                downloader=pooch.HTTPDownloader(timeout=TIMEOUT),
            )
        except ValueError:  # another checksum
            altered = True
            failures.append(f"{address}/{name}: another file")
        except OSError as error:  # all errors of the network are such
            failures.append(f"{address}/{name}: {error}")
        else:
            return
    if altered:
        raise DataError(
            f"{name} was received with another SHA-256 than the published file's {wanted[:12]}…: "
            "upstream changed it, or the download was cut short. Try again, or look at the "
            f"origin. Tried: {'; '.join(failures)}."
        )
    raise RequestError(
        f"{name} could not be fetched. Tried: {'; '.join(failures)}. Check the network, or copy "
        "the files by hand and set SEAKEEP_DATA_DIR."
    )
