"""Tables of a study file: models, training and test windows, statistics; frozen and validated.

A study is a campaign and a few choices. Settings that it leaves out are the paper's: ten training
windows drawn from the first halves, ten test windows of 15 encounter periods from the second, the
deterministic model and the ensemble, all of them with the same windows and the same draws.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from seakeep.campaign import Campaign, read_campaign
from seakeep.campaign.readers import expand
from seakeep.campaign.settings import ModelSettings
from seakeep.errors import did_you_mean
from seakeep.files import digest_of, expanded, is_there, sha256_of
from seakeep.study.resolve import mistakes_of
from seakeep.toml import (
    Count,
    Mistake,
    Names,
    Positive,
    Table,
    read_toml,
    refusal,
    validated,
)

FORMAT = 11
"""Goes into digest and result: raise it when the same settings give other arrays than before."""

Preset = Literal["paper", "recommended"]
Placement = Literal["random", "apart"]


class GeneralStudySettings(Table):
    """``[study]``: which campaign, which channels, which preset, which seed."""

    campaign: str
    """the campaign file, relative to the study file"""
    name: str = ""
    """a name for titles and tables"""
    description: str = ""
    """free text"""
    model: str | None = None
    """key of the campaign's [models.NAME] whose channels are used"""
    states: Names = ()
    """list of channels that the models forecast"""
    inputs: Names = ()
    """list of channels that drive the models"""
    preset: Preset = "paper"
    """'paper' or 'recommended', for models that state no other"""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """an integer, 0 or more and below 2^64"""
    encounter_period: Positive | None = None
    """seconds, that lengths are multiples of; left out, the campaign's"""
    truth: str | None = None
    """folder of RUN.nc with the true channels (the virtual tank's)"""


class StudyModelSettings(ModelSettings):
    """``[models.NAME]`` of a study: as in a campaign, with the study's channels and preset."""

    states: Names = ()
    """left out: the study's"""
    inputs: Names = ()
    """left out: the study's"""


class TrainingSettings(Table):
    """``[training]``: what the models learn from."""

    scheme: Literal["halves", "pooled", "leave_out"] = "halves"
    """'halves' (windows of the training spans), 'pooled' (all training spans at once) or
    'leave_out' (all runs but those that test)"""
    runs: Names = ()
    """list of runs; left out, the training runs"""
    leave_out: Literal["auto", "run", "sea_state"] = "auto"
    """'auto', a run and those that repeat its waves; 'run', a run alone; 'sea_state', all runs of
    one sea state at once"""
    windows: Count | None = 10
    """a number of training windows, with placement = 'apart' at most; belongs to scheme =
    'halves'"""
    placement: Placement = "random"
    """'random' as in the paper, or 'apart': without overlap"""

    @model_validator(mode="after")
    def _keys_fit_scheme(self) -> TrainingSettings:
        stated = self.model_fields_set
        if self.scheme != "halves" and (extra := stated & {"windows", "placement"}):
            raise ValueError(
                f"{sorted(extra)[0]!r} belongs to scheme = 'halves', and '{self.scheme}' takes the "
                "whole spans; remove it"
            )
        if self.scheme != "leave_out" and "leave_out" in stated:
            raise ValueError("'leave_out' belongs to scheme = 'leave_out'; remove it")
        return self


class TestSetSettings(Table):
    """``[tests.NAME]``: windows that are forecast and judged."""

    __test__ = False  # not a test class, although pytest would collect it by its name

    runs: Names = ()
    """list of runs; left out, the test runs"""
    waves: Literal["regular", "irregular"] | None = None
    """'regular' or 'irregular': only such runs; a run whose waves are not stated counts as
    irregular"""
    windows: Count | None = 10
    """number of test windows; with placement = 'apart' at most"""
    length: Positive = 15.0
    """length of a window in encounter periods"""
    placement: Placement = "random"
    """'random' as in the paper, or 'apart': without overlap"""
    part: Literal["test", "whole"] | None = None
    """where windows are placed: in the 'test' spans, or in 'whole' runs; left out, in whole runs
    with scheme = 'leave_out' alone"""
    startup: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """seconds cut off the start of each test span"""
    label: str = ""
    """words for titles"""


class StatisticsSettings(Table):
    """``[statistics]``: bootstrap and bands."""

    n_series: Annotated[int, Field(ge=2)] = 100
    """number of bootstrapped series, 2 or more"""
    level: Annotated[float, Field(gt=0, lt=1)] = 0.95
    """probability of the band, such as 0.95"""
    split_period: Positive = 3.0
    """period between the low-frequency and the wave-frequency band of ε(t), in encounter periods"""
    calibrate: bool | None = None
    """whether the bands of ensembles are calibrated too, on training data that members have not
    read; left out, with preset = 'recommended' alone"""
    scale: Literal["spread", "constant", "learnt"] = "spread"
    """what the half-width of a calibrated band follows: 'spread', that of the members with a floor,
    'constant', the members' band moved by as much everywhere, or 'learnt' from spread, horizon and
    waves"""
    densities_of: str | None = None
    """the test set whose densities are compared; left out, the first"""


class OutputSettings(Table):
    """``[output]``: what is kept beside the arrays that are judged, and what a report shows."""

    shown_windows: Annotated[int, Field(ge=0)] = 2
    """windows of the first test set that figures show; of the others one"""
    eigenvalues: bool = True
    """true or false"""
    regularisation: bool = False
    """whether single models with delay_rows = 'ridge' are identified without λ and by truncated
    singular values too, to compare stability, time and error"""
    paper: bool = False
    """whether the report puts the paper's published divergences beside those of the study"""


class StudySettings(Table):
    """A whole study file."""

    study: GeneralStudySettings
    models: dict[str, StudyModelSettings] = Field(
        default_factory=lambda: {
            "deterministic": StudyModelSettings(kind="hankel_dmdc"),
            "bayesian": StudyModelSettings(kind="bayesian_hankel_dmdc"),
        },
        min_length=1,
    )
    training: TrainingSettings = TrainingSettings()
    tests: dict[str, TestSetSettings] = Field(
        default_factory=lambda: {"irregular": TestSetSettings(waves="irregular")}, min_length=1
    )
    statistics: StatisticsSettings = StatisticsSettings()
    output: OutputSettings = OutputSettings()

    @property
    def calibrates(self) -> bool:
        """Whether the bands of ensembles are calibrated."""
        stated = self.statistics.calibrate
        return self.study.preset == "recommended" if stated is None else stated

    @model_validator(mode="after")
    def _names(self) -> StudySettings:
        wanted = self.statistics.densities_of
        if wanted is not None and wanted not in self.tests:
            raise ValueError(
                f"statistics.densities_of = {wanted!r} is not a table of [tests]; choose one of "
                f"{', '.join(self.tests)}"
            )
        for group in (self.models, self.tests):
            for name in group:
                if not re.fullmatch(r"[\w-]*[a-z0-9][\w-]*", name, re.ASCII | re.IGNORECASE):
                    raise ValueError(
                        f"the name {name!r} must hold a letter or digit, and nothing beside "
                        "letters, digits, '_' and '-': files are named after it; rename it"
                    )
        return self


@dataclass(frozen=True)
class Study:
    """A study: its settings and the campaign that it is about.

    Made by :func:`read_study`.

    Parameters
    ----------
    path : Path
        The study file; paths in it are relative to its folder.
    settings : StudySettings
        What it says.
    campaign : Campaign
        The campaign; its runs are not read yet.
    states, inputs : tuple of str
        Channels that the models forecast, and those that drive them.
    """

    path: Path
    settings: StudySettings
    campaign: Campaign
    states: Names
    inputs: Names

    @property
    def name(self) -> str:
        """Name of the study; the campaign's where it states none."""
        return self.settings.study.name or self.campaign.name

    @property
    def truth_folder(self) -> Path | None:
        """Folder of the true channels, where there is one."""
        stated = self.settings.study.truth
        return None if stated is None else expand(stated, self.path.parent)

    @property
    def digest(self) -> str:
        """SHA-256 of what the results depend on: settings, campaign, raw files, the truth."""
        content = self.settings.model_dump(
            mode="json",
            exclude={
                "study": {"name", "description", "campaign", "truth", "model"},
                "tests": {"__all__": {"label"}},
                "output": {"paper"},
            },
        )
        content["channels"] = [list(self.states), list(self.inputs)]
        content["campaign"] = self.campaign.digest
        content["files"] = {n: self.campaign.checksum_of(n) for n in self.campaign.runs}
        if (folder := self.truth_folder) is not None:
            files = folder.rglob("*") if is_there(folder) else ()
            content["truth"] = {
                each.relative_to(folder).as_posix(): sha256_of(each)
                for each in files
                if each.is_file()
            }
        content["format"] = FORMAT
        return digest_of(content)


def read_study(path: Path | str) -> Study:
    """Read a study file and the campaign file that it names.

    Parameters
    ----------
    path : Path or str
        The TOML file.

    Returns
    -------
    Study
        The study; no run has been read.

    Raises
    ------
    RequestError
        If a file is missing, is not TOML, or does not describe a study: one message names every key
        at fault, the value received, and the remedy.
    """
    path = expanded(path)
    settings = validated(StudySettings, read_toml(path, "study"), path, "study")
    general = settings.study
    campaign = read_campaign(expand(general.campaign, path.parent), general.preset)
    channels = general if general.states else campaign.model(general.model)
    study = Study(path, settings, campaign, channels.states, channels.inputs)
    if mistakes := _cross_checks(study):
        raise refusal(path, "study", mistakes)
    return study


def _cross_checks(study: Study) -> list[Mistake]:
    """What the study says against what the campaign has."""
    campaign, settings = study.campaign, study.settings
    known = {"channel": campaign.settings.channel_names, "run": list(campaign.runs)}
    stated: dict[tuple[str, ...], tuple[str, Names]] = {
        ("study", "states"): ("channel", study.states),
        ("study", "inputs"): ("channel", study.inputs),
        ("training", "runs"): ("run", settings.training.runs),
        **{("tests", name, "runs"): ("run", each.runs) for name, each in settings.tests.items()},
    }
    mistakes = [
        (
            place,
            f"received {name!r}, and the campaign has no such {what}."
            f"{did_you_mean(name, known[what])} {what.title()}s: {', '.join(known[what])}.",
        )
        for place, (what, names) in stated.items()
        for name in names
        if name not in known[what]
    ]
    if both := set(study.states) & set(study.inputs):
        words = f"{sorted(both)[0]!r} is among the states too; choose one."
        mistakes.append((("study", "inputs"), words))
    for name, model in settings.models.items():
        mistakes += mistakes_of(model, ("models", name), settings.study.preset)
        for key in ("states", "inputs"):
            if getattr(model, key):
                words = (
                    "all models of a study share their channels, so that they can be compared. "
                    f"State {key} in [study]."
                )
                mistakes.append((("models", name, key), words))
    return mistakes
