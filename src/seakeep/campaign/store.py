"""Prepared runs on disk: one NetCDF file per run, used again while it is fresh and unaltered."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

import xarray as xr

from seakeep.arrays import Groups, Progress
from seakeep.campaign.prepare import Campaign
from seakeep.campaign.survey import Failures, as_one
from seakeep.errors import SeakeepError, warn
from seakeep.files import check_output, load_sealed, make_folder, write_sealed
from seakeep.quality import judge_runs, warn_of_runs

PREPARED = "prepared run"
"""Kind of these files, which sets them apart from measurements."""


def write_prepared(
    campaign: Campaign,
    out_dir: Path | str | None = None,
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
    anew: bool = False,
    failures: Failures | None = None,
) -> dict[str, Path]:
    """Prepare runs and write each to a NetCDF file as soon as it is done.

    Files that are fresh stay: interrupted half-way, a second call continues. A run that cannot be
    read does not keep the others from being written.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    out_dir : Path or str, optional
        Folder for the files; the default is ``prepared`` beside the campaign file.
    names, progress
        As in :meth:`Campaign.prepare`.
    anew : bool, optional
        Prepare fresh files again too.
    failures : dict of str to SeakeepError, optional
        Takes the errors of runs that cannot be read, by run; without it they are raised as one
        error after the other runs have been written.

    Returns
    -------
    dict of str to Path
        File of each prepared run: ``NAME.nc``, written to a temporary name and renamed.

    Raises
    ------
    RequestError, DataError
        As :meth:`Campaign.prepare`.
    """
    failed = {} if failures is None else failures
    files = _files(campaign, out_dir, names)
    wanted = list(files)
    make_folder(prepared_folder(campaign, out_dir))
    inputs = [path for name in campaign.runs for path in campaign.files_of(name).values()]
    for file in files.values():
        check_output(file, PREPARED, [campaign.path, *inputs])
    steps = {} if anew else {name: run.attrs["dt"] for name, run in _fresh(campaign, files)}
    missing = [name for name in wanted if name not in steps]
    done = len(steps)

    def report(count: int, _: int, name: str) -> None:
        if progress:
            progress(done + count, len(wanted), name)

    for name, run in campaign.each_prepared(missing, report, failed):
        write_sealed(run, files[name], PREPARED)
        steps[name] = run.attrs["dt"]
    if len(set(steps.values())) > 1:  # that of fresh runs was another, which only all runs show
        return write_prepared(campaign, out_dir, wanted, progress, True, failures)
    if missing:  # a run that is new may be odd beside the others, or make one of them odd
        every = _files(campaign, out_dir, None) | files
        runs = dict(_fresh(campaign, every))
        for name in judge_runs(runs):
            write_sealed(runs[name], every[name], PREPARED)
    if failed and failures is None:
        raise as_one(failed)
    return {name: file for name, file in files.items() if name not in failed}


def load_prepared(
    campaign: Campaign,
    out_dir: Path | str | None = None,
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
    *,
    channels: Collection[str] = (),
) -> Groups:
    """Take prepared runs from their files where these are fresh, else prepare them in memory.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    out_dir : Path or str, optional
        Folder of the files; the default is ``prepared`` beside the campaign file.
    names, progress
        As in :meth:`Campaign.prepare`.
    channels : collection of str, optional
        Channels of a model; what the checks found in them is warned of.

    Returns
    -------
    dict of str to xarray.Dataset
        As :meth:`Campaign.prepare` gives them. A file that was altered is not used, with a
        warning. A file is fresh if the campaign's name and digest,
        the checksums of the raw files on which the run depends (through period and clocks too) and
        the version of seakeep are those it was written with.

    Raises
    ------
    RequestError, DataError
        As :meth:`Campaign.prepare`.
    """
    wanted = _files(campaign, out_dir, names)
    runs = dict(_fresh(campaign, wanted))
    if missing := [name for name in wanted if name not in runs]:
        runs |= campaign.prepare(missing, progress)
    if len({run.attrs["dt"] for run in runs.values()}) > 1:  # files of one rate beside others
        runs = campaign.prepare(wanted, progress)
    warn_of_runs(runs.values(), channels)
    return {name: runs[name] for name in wanted}


def prepared_folder(campaign: Campaign, out_dir: Path | str | None = None) -> Path:
    """Folder of the prepared runs: the one stated, or ``prepared`` beside the campaign file."""
    return campaign.path.parent / "prepared" if out_dir is None else Path(out_dir)


def _files(
    campaign: Campaign, out_dir: Path | str | None, names: Iterable[str] | None
) -> dict[str, Path]:
    """File of each run wanted, by default of all that are used."""
    folder = prepared_folder(campaign, out_dir)
    return {name: folder / f"{name}.nc" for name in (campaign.runs if names is None else names)}


def _fresh(campaign: Campaign, files: Mapping[str, Path]) -> Iterator[tuple[str, xr.Dataset]]:
    """Runs whose files are fresh, as they were written."""
    for name, file in files.items():
        if not file.exists():
            continue
        try:
            run = load_sealed(file, PREPARED)
        except SeakeepError as error:
            warn(f"{error} The run is prepared anew.")
            continue
        if all(run.attrs.get(key) == value for key, value in campaign.basis_of(name).items()):
            yield name, run
