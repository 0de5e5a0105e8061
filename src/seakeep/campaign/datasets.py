"""Public data sets of the examples: origin, licence, checksums; fetched only on request."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from seakeep.arrays import Progress
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.files import expanded, make_folder, sha256_of

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
    files : tuple of (str, str)
        File names and their SHA-256.
    sources : tuple of str
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
    files: tuple[tuple[str, str], ...]
    sources: tuple[str, ...] = ()
    note: str = ""


_NTNU = "https://raw.githubusercontent.com/KRSundsdal1/2D-ship-cross-section-in-regular-waves"
DATASETS = (
    PublicDataset(
        name="ntnu_ship_section",
        title="Moored ship section in regular beam waves, wave flume, 13 runs, 200 Hz",
        origin="github.com/KRSundsdal1/2D-ship-cross-section-in-regular-waves, data/3PPH, 2465cee",
        licence="CC0-1.0",
        reference="Sundsdal, Greco, Hanssen, Lugni (2025), Ocean Engineering",
        files=(
            ("3012_1.csv", "eb536916b1290cdc29085ca5dd4828126efdcaf73e21aa3dfada12f6b475add2"),
            ("3031_2.csv", "47a3dc0a2d67261e898f51575823e99309958f8892c324d141aaf891430686f2"),
            ("3041_2.csv", "16f32b878bcae41ee52436867ad75a6790ba5dd1c49bcfc973310158e4c8bd3f"),
            ("3061_1.csv", "ab8f9b4f05bd9adfea69ed13ec8ac8465519a798d94e7ed67efc1b27e2194cfe"),
            ("3061_2.csv", "cfee11dc59a9436fd2bc8a9c9175ab5fcadffba5000b40181d851e1128d390fb"),
            ("3101_3.csv", "fb9b164cdf968bc7a7fe55b505b9be402d98154b3d80298fdf6e3fe2b7572bd8"),
            ("3101_4.csv", "f9a9a8a761447079611bf6966f6cac3bce8a0643eddb32fe0ed264ed84e427c7"),
            ("3102_1.csv", "d95eb8fb64256a649cd325b13c6bb58445b7884bd63f68325a5594f3615e1b6b"),
            ("3102_2.csv", "b710884be6f4592582168bb8749dbc3d7bc333665b446d15e08746e7dfb57fe8"),
            ("3102_3.csv", "ee693d3e9a7c6291f179e4fab9d022b8063de41732df0b45dfbcd2df6ef91bd0"),
            ("3102_4.csv", "fc33ab16ac63f5c16838bb8111627176eb35e0204951052004a4de7b71af6f35"),
            ("3111_2.csv", "3b03f61ef992f1454ec23e3d00f84b87e4eba3fcf9a255823cfb1edb3f2b506a"),
            ("3142_1.csv", "7f5890b6cb200efb14e8624b3dd34468e089a0b15b544862c5447fabf209cadb"),
        ),
        sources=(
            f"{_NTNU}/2465cee/data/3PPH",
            f"{_NTNU}/903b47ffddfde5a4680cb3e91201ea3cc9a503a5/data/3PPH",
            f"{_NTNU}/0331d9fe018f9f52c00ac706864958dc4eead1ca/data/3PPH",
            f"{_NTNU}/main/data/3PPH",
        ),
    ),
    PublicDataset(
        name="sjtu_semisub",
        title="Semi-submersible in extreme irregular seas, wave basin, full-scale units, 0.774 s",
        origin="github.com/XiaoxG/waveMotion-lightning, data, 9279ed4",
        licence="MIT, copyright 2021 Xiaoxian Guo",
        reference="X. Guo et al., Shanghai Jiao Tong University",
        files=(
            ("Data01.csv", "9edb4abe6d0811452cdaf3192ee65b1b233170a3f4ad53c0c7a5ddd7dd268179"),
            ("Data02.csv", "212c7c1d46b37cc1b4b937dc66594289ea86cd0872d583892749c1de41e23028"),
        ),
        note=(
            "not fetched: the originals are pickles, which run code when they are loaded. The "
            "checksums are those of the same values as CSV (columns Time [s], WP [m], Heave [m])"
        ),
    ),
)


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
    if folder is None:
        return "unknown: SEAKEEP_DATA_DIR is not set"
    places = [(folder / dataset.name / name, wanted) for name, wanted in dataset.files]
    there = [(place, wanted) for place, wanted in places if place.is_file()]
    right = sum(sha256_of(place) == wanted for place, wanted in there)
    if right == len(places):
        return "complete"
    if not there:
        return "absent"
    return (
        f"{right} of {len(places)} files as published, {len(places) - len(there)} missing, "
        f"{len(there) - right} altered"
    )


def fetch(
    dataset: PublicDataset,
    folder: Path,
    progress: Progress | None = None,
    sources: Sequence[str] | None = None,
) -> Path:
    """Download what is missing of a data set and check it.

    Parameters
    ----------
    dataset : PublicDataset
        The data set.
    folder : Path
        The data folder; made if it does not exist.
    progress : callable, optional
        Called as ``progress(done, total, name)`` after each file.
    sources : sequence of str, optional
        Addresses to try instead of the data set's own.

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
    addresses = dataset.sources if sources is None else tuple(sources)
    if not addresses:
        raise RequestError(f"'{dataset.name}' cannot be fetched; {dataset.note}.")
    target = make_folder(folder / dataset.name)
    for done, (name, wanted) in enumerate(dataset.files, start=1):
        _fetch_file(name, wanted, target, addresses)
        if progress is not None:
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
