"""The campaign: runs as they were measured, and as a model wants them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from seakeep.campaign.channels import read_channels
from seakeep.campaign.readers import checksum, expand
from seakeep.campaign.settings import CampaignSettings, ModelSettings, RunSettings
from seakeep.campaign.validation import read_settings
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.signals import encounter_period, resample, uniform_step

__all__ = ["Campaign", "Progress", "read_campaign"]

Progress = Callable[[int, int, str], None]
"""Called after each run with how many are done, how many there are, and the run's name."""

FORMAT = 1
"""Goes into the digest: raise it when the same settings begin to give other arrays."""


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
    settings: CampaignSettings

    @property
    def name(self) -> str:
        """Name of the campaign; the file's own name where it states none."""
        return self.settings.campaign.name or self.path.stem

    @property
    def runs(self) -> list[str]:
        """Names of the runs that are used, in the file's order."""
        return [name for name, run in self.settings.runs.items() if run.role != "unused"]

    @property
    def training_runs(self) -> list[str]:
        """Names of the runs of which all or a part trains."""
        return [n for n in self.runs if "train" in _role(self.settings.runs[n])]

    @property
    def test_runs(self) -> list[str]:
        """Names of the runs of which all or a part tests."""
        return [n for n in self.runs if "test" in _role(self.settings.runs[n])]

    @property
    def models(self) -> list[str]:
        """Names of the models in ``[models.NAME]``."""
        return list(self.settings.models)

    def model(self, name: str | None = None) -> ModelSettings:
        """Look the settings of a model up.

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
            if self.settings.model is not None:
                return self.settings.model
            if len(models) == 1:
                return next(iter(models.values()))
            mend = f"Name one of {', '.join(models)}." if models else "Add [model] with 'states'."
            raise RequestError(f"{self.path} has no table [model]. {mend}")
        if name not in models:
            listed = ", ".join(models) or "none"
            raise RequestError(
                f"{self.path} has no table [models.{name}].{did_you_mean(name, models)} "
                f"Named models: {listed}."
            )
        return models[name]

    @property
    def digest(self) -> str:
        """SHA-256 of all settings on which the prepared runs depend, in hexadecimal digits."""
        content = self.settings.model_dump(mode="json", exclude={"model", "models"})
        del content["campaign"]["name"], content["campaign"]["description"]
        if self._measures_period:
            content["campaign"]["period_channel"] = self.period_channel()
        content["format"] = FORMAT
        text = json.dumps(content, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def _measures_period(self) -> bool:
        settings = self.settings
        asked = settings.preparation.steps_per_period is not None
        return asked and settings.campaign.encounter_period is None

    def file_of(self, name: str) -> Path:
        """Path of a run's file.

        Parameters
        ----------
        name : str
            Name of the run.

        Returns
        -------
        Path
            The path, environment variables expanded.

        Raises
        ------
        RequestError
            If there is no such run, or an environment variable is not set.
        """
        return expand(self._run(name).file, self.path.parent)

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
        path = self.file_of(name)
        dataset = read_channels(path, self.settings, name)
        step = uniform_step(dataset["time"].to_numpy(), f"run '{name}' ({path})")
        return dataset.assign_attrs(self._attributes(name, dataset, step, path))

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
        stated = self.settings.campaign.period_channel
        if stated is not None:
            return stated
        inputs = [n for model in self.settings.all_models().values() for n in model.inputs]
        waves = [n for n in (*inputs, *self.settings.channel_names) if n.startswith("eta_")]
        if not (waves or inputs):
            raise RequestError(
                f"{self.path}: no wave channel to take the encounter period from. State "
                "encounter_period (s) or period_channel in [campaign], or name a channel eta_…"
            )
        return [*waves, *inputs][0]

    def encounter_period(self) -> float:
        r"""Mean encounter period :math:`\hat T` of the campaign.

        Returns
        -------
        float
            The period stated in ``[campaign]``, s; without it, the mean over the irregular runs
            (all used runs if none is marked irregular) of the zero-up-crossing period of
            :meth:`period_channel`, each over the run's span, at the file's own rate.

        Raises
        ------
        RequestError
            If there is no wave channel.
        DataError
            If a record holds fewer than two crossings.
        """
        stated = self.settings.campaign.encounter_period
        if stated is not None:
            return stated
        channel = self.period_channel()
        irregular = [n for n in self.runs if self.settings.runs[n].waves == "irregular"]
        periods = []
        for name in irregular or self.runs:
            raw = self._cropped(self.read_run(name), name)
            try:
                periods.append(encounter_period(raw[channel].to_numpy(), raw.attrs["dt"]))
            except DataError as error:
                raise DataError(f"run '{name}', channel '{channel}': {error}") from None
        if not periods:
            raise RequestError(f"{self.path} has no run in use. Give a run another role.")
        return float(np.mean(periods))

    def prepare(
        self, names: Iterable[str] | None = None, progress: Progress | None = None
    ) -> dict[str, xr.Dataset]:
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
        wanted = list(self.runs if names is None else names)
        for name in wanted:
            self._run(name)
        period, dt = self._period_and_step()
        prepared: dict[str, xr.Dataset] = {}
        for done, name in enumerate(wanted, 1):
            raw = self.read_run(name)
            if dt is None:
                dt = float(raw.attrs["dt"])
            stated = self.settings.preparation.model_fields_set & {"sampling_rate", "dt"}
            if not stated and period is None and _strays(raw, dt):
                raise RequestError(
                    f"the runs differ in rate: '{wanted[0]}' has a step of {dt:g} s and '{name}' "
                    f"one of {raw.attrs['dt']:g} s. State sampling_rate (Hz) or dt (s) in "
                    "[preparation]."
                )
            run = self._cropped(self._resampled(raw, dt), name)
            run.attrs.update(self._attributes(name, run, dt, self.file_of(name)))
            if period is not None:
                run.attrs["encounter_period"] = period
            prepared[name] = run
            if progress is not None:
                progress(done, len(wanted), name)
        return prepared

    def _period_and_step(self) -> tuple[float | None, float | None]:
        """Encounter period, if it is stated or needed, and the common step, if there is one."""
        preparation = self.settings.preparation
        if preparation.steps_per_period is not None:
            period = self.encounter_period()
            return period, period / preparation.steps_per_period
        if preparation.sampling_rate is not None:
            return None, 1.0 / preparation.sampling_rate
        return None, preparation.dt

    def _resampled(self, raw: xr.Dataset, dt: float) -> xr.Dataset:
        time = raw["time"].to_numpy()
        count = int(np.floor((time[-1] - time[0]) / dt * (1 + 1e-9) + 1e-6)) + 1
        new_time = time[0] + dt * np.arange(count)
        names = list(raw.data_vars)
        series = np.column_stack([raw[name].to_numpy() for name in names])
        if _strays(raw, dt):
            if count < 2:
                raise RequestError(
                    f"run '{raw.attrs['run']}' of {time[-1] - time[0]:g} s is shorter than two "
                    f"steps of {dt:g} s. Correct [preparation]."
                )
            # The last instant may lie a rounding beyond the record.
            inside = np.minimum(new_time, time[-1]) if new_time[-1] > time[-1] else new_time
            series = resample(series, time, inside, self.settings.preparation.attenuation)
        else:
            series = series[:count]
        variables = {
            name: ("time", series[:, i].copy(), raw[name].attrs) for i, name in enumerate(names)
        }
        coordinates = {"time": ("time", new_time, raw["time"].attrs)}
        return xr.Dataset(variables, coordinates, raw.attrs)

    def _cropped(self, run: xr.Dataset, name: str) -> xr.Dataset:
        settings = self._run(name)
        time, dt = run["time"].to_numpy(), float(np.median(np.diff(run["time"].to_numpy())))
        for key in ("span", "train", "test"):
            span = getattr(settings, key)
            if span is None:
                continue
            finite = [edge for edge in span if np.isfinite(edge)]
            if any(not time[0] - dt < edge < time[-1] + dt for edge in finite):
                raise RequestError(
                    f"runs.{name}.{key}: received [{span[0]:g}, {span[1]:g}] s, and the record "
                    f"runs from {time[0]:g} to {time[-1]:g} s. Correct the span; 'inf' stands for "
                    "the end."
                )
        if settings.span is None:
            return run
        kept = _inside(time, settings.span, dt)
        if kept.sum() < 2:
            raise RequestError(
                f"runs.{name}.span: [{settings.span[0]:g}, {settings.span[1]:g}] s holds "
                f"{kept.sum()} sample(s) at a step of {dt:g} s. Lengthen the span."
            )
        return run.isel(time=kept)

    def _attributes(self, name: str, run: xr.Dataset, dt: float, path: Path) -> dict[str, Any]:
        settings, rig, general = self._run(name), self.settings.rig, self.settings.campaign
        time = run["time"].to_numpy()
        attributes: dict[str, Any] = {
            "run": name,
            "campaign": self.name,
            "campaign_digest": self.digest,
            "seakeep_version": version(),
            "file": settings.file,
            "file_sha256": checksum(path),
            "dt": float(dt),
            "scale_factor": general.scale_factor,
            "sea_state": settings.sea_state,
            "role": _role(settings),
            "waves": settings.waves,
            "water_depth": rig.water_depth,
            "wave_direction": rig.wave_direction,
            "frame": rig.frame,
            "encounter_period": general.encounter_period,
            "probe_offset": settings.probe_offset,
            "probe_offset_span": settings.probe_offset_span,
        }
        whole = (float(time[0]), float(time[-1]))
        for use in ("train", "test"):
            span = getattr(settings, use)
            if span is None and _role(settings) == use:
                span = whole
            if span is not None:
                kept = time[_inside(time, span, dt)]
                if kept.size:
                    attributes[f"{use}_span"] = (float(kept[0]), float(kept[-1]))
        return {key: value for key, value in attributes.items() if value is not None}


def _role(settings: RunSettings) -> str:
    if settings.train and settings.test:
        return "train and test"
    if settings.train or settings.test:
        return "train" if settings.train else "test"
    return settings.role or "train"


def _strays(raw: xr.Dataset, dt: float) -> bool:
    """Whether a record's own step leads it away from a grid of `dt` by more than rounding.

    Times written with few decimals give a step that is off by a part of a sample over the record.
    """
    return bool(abs(raw.attrs["dt"] - dt) * raw.sizes["time"] > 0.05 * dt)


def _inside(time: Any, span: tuple[float, float], dt: float) -> Any:
    slack = 1e-6 * dt
    return (time >= span[0] - slack) & (time <= span[1] + slack)


def version() -> str:
    """Version of seakeep, "unknown" where it is not installed."""
    try:
        return metadata.version("seakeep")
    except metadata.PackageNotFoundError:
        return "unknown"


def read_campaign(path: Path | str) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    path : Path or str
        The TOML file.

    Returns
    -------
    Campaign
        The campaign; the runs' files are not touched yet.

    Raises
    ------
    RequestError
        If the file is missing or no TOML, or says what a campaign cannot say: one message names
        every key at fault, the value received, and the mend.
    """
    path = Path(path).expanduser()
    return Campaign(path, read_settings(path))
