"""The campaign: runs as measured, as models take them, and as files that keep them prepared.

One NetCDF file per run is used again while it is fresh and unaltered.
"""

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import xarray as xr

from seakeep.arrays import Groups, Progress, number, whole_number
from seakeep.campaign.live_chain import LiveChain
from seakeep.campaign.pipeline import Run, celerity_of, checked, cropped, resampled, strays
from seakeep.campaign.readers import checksum, expand
from seakeep.campaign.settings import (
    CampaignSettings,
    ModelSettings,
    RunSettings,
    cross_checks,
    span_mistakes,
)
from seakeep.campaign.survey import Failures, Survey, as_one, survey
from seakeep.errors import (
    DataError,
    MissingFileError,
    RequestError,
    SeakeepError,
    did_you_mean,
    warn,
)
from seakeep.files import (
    check_output,
    digest_of,
    expanded,
    load_sealed,
    make_folder,
    version,
    write_sealed,
)
from seakeep.quality import as_json, judge_runs, warn_of, warn_of_runs
from seakeep.signals import Clock, uniform_step
from seakeep.signals.time_axis import inside
from seakeep.signals.waves import noise_floor
from seakeep.toml import lengths, parse_length, read_toml, validated

FORMAT = 18
"""Goes into the digest: raise it when the same settings give other arrays or findings."""
PREPARED = "prepared run"
"""Kind of the files of prepared runs, which sets them apart from measurements."""


@dataclass(frozen=True)
class Campaign:
    """A campaign: the rig, the channel map, the runs, and how they are prepared.

    Made by :func:`read_campaign`; nothing is read from the runs' files before they are asked for.

    Parameters
    ----------
    path : Path
        The campaign file; paths in it are relative to its folder.
    settings : CampaignSettings
        What it says.
    """

    path: Path
    settings: CampaignSettings = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the campaign; the file's own name where it states none."""
        return self.settings.campaign.name or self.path.stem

    @property
    def runs(self) -> list[str]:
        """Names of the runs that are used, in the file's order."""
        return self.settings.used_runs

    @property
    def training_runs(self) -> list[str]:
        """Names of the runs of which all or a part trains."""
        return [n for n in self.runs if "train" in self.settings.runs[n].serves]

    @property
    def test_runs(self) -> list[str]:
        """Names of the runs of which all or a part tests."""
        return [n for n in self.runs if "test" in self.settings.runs[n].serves]

    def model(self, name: str | None = None) -> ModelSettings:
        """Return the settings of a model.

        Parameters
        ----------
        name : str, optional
            Key in ``[models.NAME]``; the default is ``[model]``, or the only one there is.

        Returns
        -------
        ModelSettings
            The settings, validated; no file is touched.

        Raises
        ------
        RequestError
            If there is no such model.
        """
        models = self.settings.models
        if name is None:
            if self.settings.model:
                return self.settings.model
            if len(models) == 1:
                return next(iter(models.values()))
            mend = f"Name one of {', '.join(models)}." if models else "Add [model] with 'states'."
            raise RequestError(f"{self.path} has no table [model]. {mend}")
        if name not in models:
            raise RequestError(
                f"{self.path} has no table [models.{name}].{did_you_mean(name, models)} "
                f"Named models: {', '.join(models) or 'none'}."
            )
        return models[name]

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all settings on which the prepared runs depend, in hexadecimal digits."""
        content = self.settings.model_dump(
            mode="json",
            exclude={"model": True, "models": True, "campaign": {"name", "description"}},
        )
        if self._measures_period:
            content["campaign"]["period_channel"] = self.period_channel()
        content["celerity_channels"] = self.settings.celerity_channels
        content["format"] = FORMAT
        return digest_of(content)

    @property
    def _measures_period(self) -> bool:
        asked = self.settings.preparation.steps_per_period or self._lengths
        return bool(asked) and not self.settings.campaign.encounter_period

    @cached_property
    def _lengths(self) -> list[tuple[str, ...]]:
        """Places of what counts in encounter periods; models keep theirs, which become samples."""
        return [place for place in lengths(self.settings) if place[0] not in ("model", "models")]

    def files_of(self, name: str) -> dict[str, Path]:
        """Paths of a run's files.

        Parameters
        ----------
        name : str
            Name of the run.

        Returns
        -------
        dict of str to Path
            Path by instrument, environment variables expanded; one file alone has the name "".

        Raises
        ------
        RequestError
            If there is no such run, or an environment variable is not set.
        """
        run = self._run(name)
        files = {"": run.file} if run.file is not None else run.files
        return {key: expand(file, self.path.parent) for key, file in files.items()}

    def checksum_of(self, name: str) -> str:
        """SHA-256 of a run's files, one after the other."""
        return " ".join(checksum(path) for path in self.files_of(name).values())

    def basis_of(self, name: str) -> dict[str, str]:
        """Attributes by which a prepared run is fresh: the campaign, its digest, our version.

        And the SHA-256 of all files on which the run depends, through period and clocks too.
        """
        pooled = self.settings.instruments.pool_drift and self._run(name).files
        sums = []
        for each in dict.fromkeys([name, *(self.runs if pooled or self._measures_period else [])]):
            try:
                sums.append(self.checksum_of(each))
            except (MissingFileError, OSError):
                sums.append("unreadable")
        return {
            "campaign": self.name,
            "campaign_digest": self.digest,
            "basis_sha256": hashlib.sha256(" ".join(sums).encode()).hexdigest(),
            "seakeep_version": version(),
        }

    def _run(self, name: str) -> RunSettings:
        runs = self.settings.runs
        if name not in runs:
            raise RequestError(
                f"{self.path} has no run '{name}'.{did_you_mean(name, runs)} "
                f"Runs: {', '.join(runs)}."
            )
        return runs[name]

    def read_run(self, name: str) -> xr.Dataset:
        """Read a run as it was measured: named channels in SI units, at the file's own rate.

        Parameters
        ----------
        name : str
            Name of the run.

        Returns
        -------
        xarray.Dataset
            Dimension ``time`` (s, the file's clock), the whole record; each channel with ``units``
            and ``long_name``, derived channels included.

        Raises
        ------
        RequestError
            If the run, its file or a column does not exist, or a unit is missing or does not fit.
        DataError
            If the file is damaged, has gaps, or its times are not uniform.
        """
        run = self._survey([name], bool(self._lengths)).channels(name)
        dt = uniform_step(run.reference_time, f"run '{name}'")
        run = resampled(run, dt)
        return run.data.assign_attrs(self._attributes(run, dt))

    def clocks(self, names: Iterable[str] | None = None) -> dict[str, dict[str, Clock]]:
        """Clocks of the loggers of each run against the reference.

        Parameters
        ----------
        names : iterable of str, optional
            The runs wanted; the default is all that are used.

        Returns
        -------
        dict of str to dict of str to Clock
            By run and logger, the reference first. Drifts are pooled over all used runs whose
            clocks agree, unless ``pool_drift = false`` in ``[instruments]``.

        Raises
        ------
        RequestError, DataError
            If a file of a wanted run cannot be read or a clock not found. Others that cannot be
            read are left out of the pooled drifts, with a warning.
        """
        wanted = list(self.runs if names is None else names)
        surveyed = self._survey(wanted, False)
        return {name: dict(surveyed.clocks_of(name)) for name in wanted}

    def _survey(
        self, wanted: list[str], needs_period: bool, progress: Progress | None = None
    ) -> Survey:
        """Clocks of the wanted runs, and the encounter period if needed."""
        for name in wanted:
            self._run(name)
        stated = self.settings.campaign.encounter_period
        channel = self.period_channel() if needs_period and not stated else None
        if channel and not self.settings.period_runs:
            raise RequestError(
                f"{self.path} has no run with waves in use. Give a run another role, or state "
                "encounter_period (s) in [campaign]."
            )
        surveyed = survey(self.settings, self.files_of, wanted, channel, progress)
        if surveyed.period:
            for place, words in span_mistakes(self.settings, surveyed.period):
                raise RequestError(f"{'.'.join(place)}: {words}")
        return surveyed

    def period_channel(self) -> str:
        """Name of the wave channel that defines the encounter period.

        Returns
        -------
        str
            ``period_channel`` of ``[campaign]``; without it, the first input of a model that is a
            wave elevation (``eta_…``), else the first wave elevation, else the first input.

        Raises
        ------
        RequestError
            If there is neither.
        """
        wave = self.settings.wave_channel
        if wave is None:
            raise RequestError(
                f"{self.path}: no wave channel to take the encounter period from. State "
                "encounter_period (s) or period_channel in [campaign], or name a channel eta_…"
            )
        return wave

    def encounter_period(self) -> float:
        r"""Mean encounter period :math:`\hat T` of the campaign.

        Returns
        -------
        float
            The period stated in ``[campaign]``, s; without it, the mean over the irregular runs
            (all used runs with waves if none is) of the zero-up-crossing period of
            :meth:`period_channel`, each over the run's span, at the file's own rate. A run that
            cannot be read, or holds fewer than two crossings, is left out with a warning; those
            of fewer than ten waves are left out where others hold more.

        Raises
        ------
        RequestError
            If there is no wave channel.
        DataError
            If no run is left.
        """
        return self.settings.campaign.encounter_period or self._survey([], True).period

    def seconds(self, stated: float | str) -> float:
        """Seconds of a length or an instant that may be stated in encounter periods.

        Parameters
        ----------
        stated : float or str
            A number of seconds, or a text such as ``"15 T"``.

        Returns
        -------
        float
            Seconds.

        Raises
        ------
        RequestError
            If the text is not a length, or the campaign has no encounter period.
        """
        if not isinstance(stated, str):
            return number(stated, "a length")
        length = parse_length(stated)
        if length.unit != "T":
            raise RequestError(f"received '{stated}', a frequency. Give a length such as '15 T'.")
        return length.at(self.encounter_period())

    def prepare(
        self, names: Iterable[str] | None = None, progress: Progress | None = None
    ) -> Groups:
        """Prepare runs: one uniform step for all of them, cut to their spans.

        Each record is resampled as a whole, onto instants that are multiples of the step from the
        record's own first instant, and then cut.

        Parameters
        ----------
        names : iterable of str, optional
            The runs wanted; the default is all that are used.
        progress : callable, optional
            Called as ``progress(done, total, name)`` after each run.

        Returns
        -------
        dict of str to xarray.Dataset
            Run by name: dimension ``time``, channels with ``units`` and ``long_name``, and in the
            attributes what later steps need (``dt``, ``role``, ``train_span``, ``test_span``,
            ``water_depth``, ``encounter_period``, ``campaign_digest`` and more).

        Raises
        ------
        RequestError
            As :meth:`read_run`; also if a span lies outside the record, or the files differ in
            rate and ``[preparation]`` states none.
        DataError
            As :meth:`read_run`.
        """
        runs = dict(self.each_prepared(names, progress))
        judge_runs(runs)
        return runs

    def each_prepared(
        self,
        names: Iterable[str] | None,
        progress: Progress | None,
        failures: Failures | None = None,
    ) -> Iterator[tuple[str, xr.Dataset]]:
        """Prepare runs one after the other, as :meth:`prepare` does; only one is held at a time.

        Parameters
        ----------
        names, progress
            As in :meth:`prepare`.
        failures : dict of str to SeakeepError, optional
            Takes the errors of runs that cannot be read, by run, in place of raising them.

        Yields
        ------
        (str, xarray.Dataset)
            Name and run.

        Raises
        ------
        RequestError, DataError
            As :meth:`prepare`.
        """
        wanted = list(self.runs if names is None else names)
        surveyed = self._survey(wanted, self._measures_period, progress)
        dt, first = surveyed.dt, ""
        reported = {(str(self.settings.wave_channel), "PERIOD")}  # the survey has warned of it
        for done, name in enumerate(wanted, 1):
            try:
                run = surveyed.channels(name)
                own = uniform_step(run.reference_time, f"run '{name}'")
                dt, first = dt or own, first or name
                if not surveyed.dt and strays(own, run.reference_time.size, dt):
                    raise RequestError(
                        f"the runs differ in rate: '{first}' has a step of {dt:g} s and '{name}' "
                        f"one of {own:g} s. State sampling_rate (Hz) or dt (s) in [preparation]."
                    )
                run = cropped(resampled(run, dt))
                run.data.attrs.update(self._attributes(run, dt))
                run = checked(run, surveyed.left_out)
                warn_of(run.findings, reported)
                data = run.data
                data.attrs["quality"] = as_json(run.findings)
                for channel in data.data_vars.values():
                    channel.attrs["noise_std"] = noise_floor(channel.values)
            except SeakeepError as error:
                is_named = f"'{name}'" in str(error)
                failure = error if is_named else type(error)(f"run '{name}': {error}")
                if failures is None or not isinstance(error, DataError | MissingFileError):
                    raise failure from None
                failures[name] = failure
                if progress:
                    progress(done, len(wanted), f"{name} cannot be prepared")
                continue
            if surveyed.period:
                data.attrs["encounter_period"] = surveyed.period
            if progress:
                progress(done, len(wanted), name)
            yield name, data

    def live_chain(
        self, run: str, *, delay: float | str = "1 T", window: float | str = "40 T", every: int = 8
    ) -> LiveChain:
        """The chain of preparation for use in service: raw samples in, model samples out.

        Parameters
        ----------
        run : str
            A run whose files have the columns, units and clocks of the loggers in service.
        delay : float or str, optional
            Time after a model sample before it is handed out, s or encounter periods: filters look
            both ways, and a sample is the closer to the offline one the more of what follows it is
            known.
        window : float or str, optional
            Length of the record that the chain works on; it must hold the memory of all filters.
        every : int, optional
            Model samples that are made together: the longer, the less work.

        Returns
        -------
        LiveChain
            Without samples yet.

        Raises
        ------
        RequestError
            If there is no such run, a logger sends no instants, or a length is out of range.
        DataError
            If a file of the run cannot be read.
        """
        surveyed = self._survey([run], self._measures_period)
        settings = surveyed.settings
        dt = surveyed.dt or uniform_step(surveyed.channels(run).reference_time, run)
        late, length = self.seconds(delay), self.seconds(window)
        if not 0 <= 4 * late <= length:
            raise RequestError(
                f"delay is {late:g} s and window {length:g} s; the window must be at least four "
                "times as long as the delay. Raise window."
            )
        whole = settings.runs[run].model_copy(update={"record": None})
        changed: dict[str, Any] = {"runs": {**settings.runs, run: whole}}
        if settings.preparation.gaps == "refuse":  # rows get lost in service
            changed["preparation"] = settings.preparation.model_copy(update={"gaps": "mask"})
        source = replace(surveyed.read(run), settings=settings.model_copy(update=changed))
        return LiveChain(source, dt, late, length, whole_number(every, "every"))

    def _attributes(self, run: Run, dt: float) -> dict[str, Any]:
        """Attributes that settings and clocks give to a run that was cut."""
        name, settings, campaign = run.name, run.own, run.settings
        rig, general = campaign.rig, campaign.campaign
        time = run.data["time"].values
        attributes: dict[str, Any] = {
            **self.basis_of(name),
            "file_sha256": self.checksum_of(name),
            "run": name,
            "file": settings.file or ", ".join(settings.files.values()),
            "preparation_preset": campaign.preparation.preset,
            "dt": dt,
            "scale_factor": general.scale_factor,
            "sea_state": settings.sea_state,
            "role": settings.serves,
            "waves": settings.waves,
            "water_depth": rig.water_depth,
            "wave_direction": rig.wave_direction,
            "frame": rig.frame,
            "encounter_period": general.encounter_period,
            "probe_offset": settings.probe_offset,
            **celerity_of(run, dt),
        }
        for use in ("train", "test"):
            span = run.span(use)
            if not span and settings.serves == use:
                span = time[0], time[-1]
            if span:
                used = time[inside(time, span, dt)]
                if used.size:
                    attributes[f"{use}_span"] = (float(used[0]), float(used[-1]))
        for logger, clock in list(run.clocks.items())[1:]:
            attributes |= {
                f"clock_{logger}": clock.describe(),
                f"clock_{logger}_method": clock.method,
                f"clock_{logger}_count": clock.count,
                f"clock_{logger}_offset": clock.offset,
                f"clock_{logger}_offset_error": clock.offset_error,
                f"clock_{logger}_drift_ppm": 1e6 * clock.drift,
                f"clock_{logger}_drift_error_ppm": 1e6 * clock.drift_error,
            }
        attributes |= settings.parameters
        return {key: value for key, value in attributes.items() if value is not None}


def read_campaign(path: Path | str, preset: str | None = None) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    path : Path or str
        The TOML file.
    preset : {"paper", "recommended"}, optional
        Whose filters runs are prepared with where ``[preparation]`` states no preset; the default
        is the preset of ``[model]``, or the one that all ``[models.NAME]`` share.

    Returns
    -------
    Campaign
        The campaign; the runs' files are not touched yet.

    Raises
    ------
    RequestError
        If the file is missing, is not TOML, or does not describe a campaign: one message names
        every key at fault, the value received, and the remedy.
    """
    path = expanded(path)
    content = read_toml(path, "campaign", " Draft one with 'seakeep init FILE…'.")
    settings = validated(CampaignSettings, content, path, "campaign", cross_checks)
    preparation = settings.preparation.with_preset(preset or settings.preset)
    return Campaign(path, settings.model_copy(update={"preparation": preparation}))


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
