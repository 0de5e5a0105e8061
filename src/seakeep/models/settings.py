"""Settings of a model, their checks, priors of them, and the conversion of periods to samples.

A prior is anything with a quantile function ``ppf``: one of the classes here, or a frozen
distribution of :mod:`scipy.stats`. One uniform number between 0 and 1 makes one draw, so Monte
Carlo and quasi-random points are used alike. A prior of a length states its unit, as in
``Uniform("10 T", "30 T")``; bare numbers count samples.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import Any, ClassVar, Literal, Protocol, Self, get_args, runtime_checkable

import numpy as np
import xarray as xr

from seakeep.arrays import (
    TINY,
    Datasets,
    Json,
    check_choice,
    check_flag,
    check_keys,
    number,
    plain,
    settings_of,
    whole_number,
)
from seakeep.core.embedding import History
from seakeep.errors import SHOWN, RequestError, did_you_mean, quiet, warn
from seakeep.models import labelled, store
from seakeep.models.alignment import BACK, Following, ProbeAlignment
from seakeep.models.inputs import InputMap
from seakeep.models.labelled import TrainingRuns
from seakeep.models.observables import NOTHING, Observed, observables_of
from seakeep.models.readouts import ReadOuts, readouts_json, readouts_of
from seakeep.models.terms import Observable
from seakeep.toml import Length, parse_length

DelayRows = Literal["ridge", "exact"]
RidgeScale = Literal["absolute", "per_snapshot"]
Role = Literal["model", "reference"]


Bound = float | str | Length
"""Number, or a length such as ``"10 T"``."""


@runtime_checkable
class Prior(Protocol):
    """Interface of a prior."""

    def ppf(self, q: float) -> Any:
        """Quantile function: the value below which lies the probability `q`."""


class _Bounded:
    """Two bounds in order: finite numbers, or lengths, and the unit that they share."""

    key: ClassVar[str]
    least: ClassVar[float] = -math.inf
    low: Bound
    high: Bound
    bounds: tuple[float, ...]
    unit: str

    def __post_init__(self) -> None:
        name, stated = type(self).__name__, dict(vars(self))
        given = [*stated.values()]
        read = [parse_length(each) if isinstance(each, str) else each for each in given]
        units = {each.unit if isinstance(each, Length) else "" for each in read}
        values = [each.value if isinstance(each, Length) else each for each in read]
        if len(units) > 1:
            raise RequestError(
                f"{name} needs one unit; received {' and '.join(map(repr, given))}. Write 'T', for "
                "encounter periods, or 's' behind each number, or behind none."
            )
        finite = [float(x) for x in values if isinstance(x, int | float | np.number)]
        if len(finite) < len(values) or not all(map(math.isfinite, finite)):
            received = " and ".join(f"{each!r:.{SHOWN}}" for each in given)
            raise RequestError(f"{name} needs finite numbers; received {received}.")
        for key, value in stated.items():
            object.__setattr__(self, key, str(value) if isinstance(value, Length) else value)
        object.__setattr__(self, "bounds", tuple(finite))
        object.__setattr__(self, "unit", units.pop())
        low, high = finite
        if not low < high:
            raise RequestError(
                f"{name} needs its lower bound below the upper one; received {self.low!r} and "
                f"{self.high!r}. Swap them, or state a single value as it is."
            )
        if low < self.least:
            raise RequestError(
                f"{name} needs a positive lower bound; received {self.low!r}. Logarithms start "
                "above zero."
            )


@dataclass(frozen=True)
class Uniform(_Bounded):
    """Uniform between two bounds, as in the paper.

    Parameters
    ----------
    low, high : float or str
        Bounds; of a length ``"10 T"``, ``"0.5 s"``, or samples.

    Raises
    ------
    RequestError
        If they are not finite, not in order, or of two units.

    Examples
    --------
    >>> Uniform("10 T", "30 T").ppf(0.25)
    15.0
    """

    key: ClassVar[str] = "uniform"
    low: Bound
    high: Bound

    def ppf(self, q: float) -> float:
        """Quantile function."""
        low, high = self.bounds
        return low + (high - low) * q


@dataclass(frozen=True)
class LogUniform(_Bounded):
    """Uniform in the logarithm between two positive bounds.

    Parameters
    ----------
    low, high : float or str
        Bounds; of a length ``"10 T"``, ``"0.5 s"``, or samples.

    Raises
    ------
    RequestError
        If they are not finite, not positive, not in order, or of two units.

    Examples
    --------
    >>> round(LogUniform(1, 100).ppf(0.5), 12)
    10.0
    """

    key: ClassVar[str] = "log_uniform"
    least: ClassVar[float] = float(np.finfo(float).tiny)
    low: Bound
    high: Bound

    def ppf(self, q: float) -> float:
        """Quantile function."""
        low, high = self.bounds
        return float(low * (high / low) ** q)


@dataclass(frozen=True)
class Distribution:
    """A distribution of :mod:`scipy.stats` by its name.

    Parameters
    ----------
    distribution : str
        Name, such as ``"norm"``.
    parameters : mapping of str to float, optional
        Its parameters, such as ``{"loc": 1.0, "scale": 0.1}``.
    unit : str, optional
        Of a length: ``"T"``, encounter periods, or ``"s"``; samples by default.

    Raises
    ------
    RequestError
        If SciPy has no such distribution, or it takes other parameters.
    """

    distribution: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""

    def __post_init__(self) -> None:
        from scipy import stats

        kinds = stats.rv_continuous | stats.rv_discrete
        law = getattr(stats, self.distribution, None)
        if not isinstance(law, kinds):
            known = [name for name in dir(stats) if isinstance(getattr(stats, name), kinds)]
            raise RequestError(
                f"scipy.stats has no distribution '{self.distribution}'."
                f"{did_you_mean(self.distribution, known)} Name another one."
            )
        if self.unit not in ("", "s", "T"):
            raise RequestError(f"the unit of a prior is 'T' or 's'; received {self.unit!r}.")
        shapes = f"{law.shapes}, loc, scale" if law.shapes else "loc, scale"
        try:
            median = float(self.ppf(0.5))
        except TypeError:
            raise RequestError(
                f"'parameters' of '{law.name}' are {shapes}, of which loc and scale may be left "
                f"out; received {', '.join(self.parameters) or 'none'}."
            ) from None
        if not math.isfinite(median):
            raise RequestError(f"'{law.name}' with these 'parameters' has no median; correct them.")

    def ppf(self, q: float) -> float:
        """Quantile function."""
        from scipy import stats

        return float(getattr(stats, self.distribution).ppf(q, **self.parameters))


_OWN: dict[str, Any] = {each.key: each for each in (Uniform, LogUniform)}


def prior_of(name: str, value: object) -> Prior | None:
    """Read the prior of a setting.

    Parameters
    ----------
    name : str
        The setting.
    value : object
        A prior, a table such as ``{"uniform": ["10 T", "30 T"]}``, or something else.

    Returns
    -------
    Prior or None
        None for what is neither.

    Raises
    ------
    RequestError
        If a table is not that of a prior.
    """
    if isinstance(value, Prior):
        return value
    if not isinstance(value, Mapping):
        return None
    try:
        if "distribution" in value:
            return Distribution(**value)
        ((key, given),) = value.items()
        if not isinstance(given, list | tuple):
            raise TypeError
        return _OWN[key](*given)
    except RequestError as error:
        raise RequestError(f"{name}: {error}") from None
    except (TypeError, ValueError, KeyError):
        raise RequestError(
            f"{name}: a prior is one of {{ uniform = [a, b] }}, {{ log_uniform = [a, b] }}, "
            "{ distribution = 'name', parameters = { … } }; received "
            f"{value!r:.{SHOWN}}. A single value stands as it is: {name} = 5."
        ) from None


def prior_json(prior: Prior) -> Json:
    """A prior as its table, for a file.

    Parameters
    ----------
    prior : Prior
        One of this module, or a frozen distribution of scipy.stats by its public name.

    Returns
    -------
    dict
        The table; :func:`prior_of` reads it.

    Raises
    ------
    RequestError
        If the prior is of another kind.
    """
    if isinstance(prior, _Bounded):
        return {prior.key: [prior.low, prior.high]}
    if isinstance(prior, Distribution):
        return {**asdict(prior), "parameters": dict(prior.parameters)}
    dist: Any = getattr(prior, "dist", None)
    if dist is None:
        raise RequestError(
            f"the prior {prior!r} cannot be written to a file. Use one of seakeep's, or a frozen "
            "distribution of scipy.stats."
        )
    shapes = (dist.shapes or "").replace(",", " ").split()
    given = zip([*shapes, "loc", "scale"], getattr(prior, "args", ()), strict=False)
    stated = dict(given) | getattr(prior, "kwds", {})
    parameters = {name: float(value) for name, value in stated.items()}
    return prior_json(Distribution(dist.name, parameters))


def unit_of(written: object) -> str:
    """Unit of a length as a file states it: a prior, a text, or a number of samples."""
    length = parse_length(written) if isinstance(written, str) else prior_of("", written)
    return {"T": "encounter periods", "s": "s"}.get(getattr(length, "unit", ""), "samples")


@dataclass(frozen=True)
class Needs:
    """Samples that a spec asks of its runs.

    Parameters
    ----------
    snapshots : int
        Of the longest training window; 1 where all of a run trains.
    history : int
        Before the start of a forecast, that one not counted.
    inside : bool
        Whether the delay history of training lies inside the window.
    lead : int
        Input after the last instant but one that a forecast reads.
    """

    snapshots: int
    history: int
    inside: bool = False
    lead: int = 0


def periods_to_samples(periods: float, encounter_period: float, dt: float) -> int:
    """Number of samples of a time in encounter periods, to the nearest integer.

    Parameters
    ----------
    periods : float
        Length in encounter periods.
    encounter_period : float
        Encounter period, s.
    dt : float
        Time step, s.

    Returns
    -------
    int
        Samples, halves rounded up (the paper's text; its box writes the floor).

    Raises
    ------
    RequestError
        If period or step are not positive, or the step is as long as the period.
    """
    for name, value in (("encounter_period", encounter_period), ("dt", dt)):
        number(value, name, "a positive number of seconds", TINY)
    if dt >= encounter_period:
        raise RequestError(
            f"the time step dt = {dt:g} s is no shorter than the encounter period of "
            f"{encounter_period:g} s. Are the two swapped?"
        )
    return math.floor(periods * encounter_period / dt + 0.5)


def in_samples(length: float | Length, dt: float, encounter_period: float | None) -> int:
    """Number of samples of a length, to the nearest integer.

    Parameters
    ----------
    length : int or Length
        Samples, seconds or encounter periods.
    dt : float
        Time step, s.
    encounter_period : float or None
        Encounter period, s.

    Returns
    -------
    int
        Samples, halves rounded up.

    Raises
    ------
    RequestError
        If it counts in encounter periods and there is none.
    """
    if not isinstance(length, Length):
        return math.floor(length + 0.5)
    if length.unit == "s":
        return math.floor(length.value / dt + 0.5)
    if encounter_period is None:
        raise RequestError(
            f"'{length}' counts in encounter periods, and there is none. State encounter_period "
            "(s), in [campaign] or in run.attrs."
        )
    return periods_to_samples(length.value, encounter_period, dt)


def as_length(name: str, value: Any, least: int, optional: bool) -> int | Length | None:
    """A setting that is a number of samples, or a length such as ``"1 T"`` or ``"0.5 s"``.

    ``"inf T"`` of an optional one is None: all there is.
    """
    if isinstance(value, str):
        try:
            value = parse_length(value)
        except RequestError as error:
            raise RequestError(f"{name}: {error}; received {value!r:.{SHOWN}}.") from None
    if isinstance(value, Length):
        if optional and value.value == math.inf:
            return None
        if value.unit == "/T" or not 0 <= value.value < math.inf:
            raise RequestError(
                f"{name} must be a length that is not negative, such as '1 T'; received '{value}'."
            )
        return value
    return None if optional and value is None else whole_number(value, name, least)


STABLE_RADIUS = 0.999
"""Radius of ``stable=True``: a mode there decays to a third in a thousand steps, some thirty
encounter periods."""


Folds = Literal["auto", "run", "sea_state"]
FOLDS: tuple[Folds, ...] = get_args(Folds)
"""What may be held out at a time; :func:`seakeep.models.selection.groups_of` tells them apart."""


CENTRES = {"pooled": 0, "run": "30 T"}
"""Words of the reference period before a start whose means a model forecasts departures from."""


OPENED = ("observables", "alignment", "lead", "memory")
"""Settings that may be left open beside λ, in the order in which they are chosen."""


@dataclass(frozen=True)
class Select:
    """What free runs on held-out training runs choose, beside λ.

    Parameters
    ----------
    observables : bool, optional
        Whether they choose among the observables: those that are stated, or slow squares and
        powers of the wave elevations, none, one, or all of them.
    alignment, lead : bool, optional
        Whether they choose between the alignment, or the look-ahead, that is stated and none.
    memory : bool, optional
        Whether they choose between the memory that is stated and one of eight encounter periods,
        unless the waves are carried to the predicted surge.
    horizon : float or sequence of float, optional
        Lengths of the free runs, encounter periods.
    period : float, optional
        Encounter period, s; by default that of the training runs.
    folds : {"auto", "run", "sea_state"}, optional
        What is held out at a time: a run and the runs that repeat its waves, a run alone, or all
        runs of its sea state, for a model that must forecast seas that no training run holds.

    Raises
    ------
    RequestError
        If a setting is out of range.
    """

    observables: bool = False
    alignment: bool = False
    lead: bool = False
    memory: bool = False
    horizon: tuple[float, ...] = (15.0, 45.0)
    period: float | None = None
    folds: Folds = "auto"

    def __post_init__(self) -> None:
        check_choice("select: folds", self.folds, FOLDS)
        for name in OPENED:
            check_flag(f"select: {name}", getattr(self, name))
        given = self.horizon if isinstance(self.horizon, tuple | list) else (self.horizon,)
        for value in (*given, *(() if self.period is None else (self.period,))):
            what = "select: horizon (encounter periods) and period (s)"
            number(value, what, "between 1e-6 and 1e6", 1e-6, 1e6)
        if not given:
            raise RequestError("select: horizon is empty. Write horizon=(15, 45).")
        object.__setattr__(self, "horizon", tuple(float(each) for each in given))

    @property
    def opened(self) -> tuple[str, ...]:
        """Settings that are left open beside λ."""
        return tuple(name for name in OPENED if getattr(self, name))


@dataclass(frozen=True)
class HankelSettings:
    """What a model was asked to be; see :class:`seakeep.HankelDMDc` for the meaning of each.

    Raises
    ------
    RequestError
        If a setting is out of range.
    """

    kind: ClassVar[str]
    model: ClassVar[type]
    """What is fitted."""
    title: ClassVar[str] = ""
    role: ClassVar[Role] = "model"
    is_ensemble: ClassVar[bool] = False
    may_choose: ClassVar[bool] = False
    is_filter: ClassVar[bool] = False
    """Whether no state is a regressor."""
    has_path: ClassVar[bool] = True
    """Whether one Gram matrix gives the models of all λ."""
    lengths: ClassVar[Mapping[str, int]] = {
        "window": 2,
        "state_delays": 0,
        "input_delays": 0,
        "lead": 0,
        "memory": 0,
        "centre": 0,
    }
    """Settings that are lengths, and the least number of samples of each."""
    state_delays: int
    input_delays: int
    ridge: float | Literal["rollout"]
    window: int | None = None
    history: History = "before"
    delay_rows: DelayRows = "ridge"
    ridge_scale: RidgeScale = "absolute"
    rank: int | None = None
    standardize: bool = True
    alignment: ProbeAlignment | None = None
    lead: int = 0
    observables: tuple[Observable, ...] = ()
    readouts: ReadOuts = ()
    stable: bool | float = False
    memory: int = 0
    centre: int = 0

    def __post_init__(self) -> None:
        for name in (*self.lengths, "ridge"):
            object.__setattr__(self, name, self._read(name))
        if self.rank is not None:
            whole_number(self.rank, "rank")
        check_choice("history", self.history, ("before", "inside"))
        check_choice("delay_rows", self.delay_rows, ("ridge", "exact"))
        check_choice("ridge_scale", self.ridge_scale, ("absolute", "per_snapshot"))
        check_flag("standardize", self.standardize)
        if not isinstance(self.stable, bool):
            meant = "True, False or a radius above 0 and below 1, to which eigenvalues are clipped"
            number(self.stable, "stable", meant, TINY, 1.0, f" True is {STABLE_RADIUS:g}.")
        example = "mode='effective', surge='measured'"
        aligned = settings_of(ProbeAlignment, "alignment", self.alignment, example)
        object.__setattr__(self, "alignment", aligned)
        object.__setattr__(self, "observables", observables_of(self.observables))
        object.__setattr__(self, "readouts", readouts_of(self.readouts))
        self._check_readouts()
        if self.memory and (self.delay_rows != "exact" or self.stable is not False):
            raise RequestError(
                "memory averages delayed states, which takes delay_rows = 'exact' and stable = "
                f"False; received delay_rows = '{self.delay_rows}', stable = {self.stable}. Change "
                "them, or set memory = 0."
            )
        if self.rank is not None and self.ridge != 0 and not isinstance(self.ridge, Prior):
            ridge = self.ridge if isinstance(self.ridge, str) else f"{self.ridge:g}"
            warn(
                f"rank = {self.rank} truncates singular values instead of regularising, so "
                f"ridge = {ridge} is not used. Set ridge=0 to say so."
            )

    def _read(self, name: str) -> Any:
        """A length or λ, checked; an ensemble takes priors too."""
        value = getattr(self, name)
        if name == "ridge":
            if not (self.may_choose and isinstance(value, str) and value == "rollout"):
                meant = "a number, zero or positive" + ", or the word rollout" * self.may_choose
                hint = " The paper uses 100; 0 asks for the solution of least norm."
                number(value, name, meant, 0, hint=hint)
            return value
        if name == "centre":
            value = CENTRES.get(value, value) if isinstance(value, str) else value
        return as_length(name, value, self.lengths[name], name == "window")

    def resolved(self, dt: float, encounter_period: float | None) -> Self:
        """Settings whose lengths are samples.

        Parameters
        ----------
        dt : float
            Time step, s.
        encounter_period : float or None
            Encounter period, s.

        Raises
        ------
        RequestError
            If a length counts in encounter periods and there is none.
        """
        values: Json = {
            name: in_samples(value, dt, encounter_period)
            for name in self.lengths
            if isinstance(value := getattr(self, name), Length)
        }
        return replace(self, **values) if values else self

    def resolved_in(self, runs: Datasets, inputs: Sequence[str]) -> Self:
        """Settings whose lengths are samples of some runs, with the period that these have."""
        dt = labelled.common_step(runs)
        return self.resolved(
            dt, labelled.mean_period(runs, inputs) * dt if self.in_periods else None
        )

    def ridge_text(self, ridge: float) -> str:
        """A λ of these settings in words, with what it counts by."""
        per = " per snapshot pair" if self.ridge_scale == "per_snapshot" else ""
        return f"ridge {ridge:g}{per}"

    @property
    def in_periods(self) -> bool:
        """Whether a length, or a prior of one, counts in encounter periods."""
        return any(getattr(getattr(self, name), "unit", "") == "T" for name in self.lengths)

    def _check_readouts(self) -> None:
        """Refuse read-outs that these settings leave no room for."""
        aligned = self.alignment
        followed = aligned.surge_channel if aligned and aligned.surge == "predicted" else None
        kinds = {"every load": "auto"} if isinstance(self.readouts, str) else dict(self.readouts)
        if followed in kinds:
            raise RequestError(
                f"readouts: {followed} is the surge that the model follows from step to step, "
                "before any read-out. Read off another channel, or set alignment surge = 'none'."
            )
        if followed is not None and self.delay_rows != "exact":
            raise RequestError(
                "alignment surge = 'predicted' follows the last surges from step to step, which "
                f"takes delay_rows = 'exact'; received '{self.delay_rows}'. Change it, or take "
                "surge = 'measured' or 'none'."
            )
        if "auto" in kinds.values() and (self.delay_rows != "exact" or self.rank is not None):
            raise RequestError(
                "readouts = 'auto' are judged by free runs on training runs that are held "
                "out, which takes delay_rows = 'exact' and no rank; received delay_rows = "
                f"'{self.delay_rows}', rank = {self.rank}. Change them, or write 'wave'."
            )

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """Of each block of delays that is averaged the delay before its first, and its last.

        They begin after s, and double in length up to the memory.
        """
        edges = [self.state_delays]
        while edges[-1] < self.memory:
            edges.append(min(max(2 * edges[-1], 1), self.memory))
        return list(itertools.pairwise(edges))

    @property
    def state_reach(self) -> int:
        """Longest delay of the states: s, or the memory."""
        return max(self.state_delays, self.memory)

    def reach(self, input_map: InputMap) -> int:
        """Longest history that a step reads, of the states or of the inputs."""
        return max(self.state_reach, input_map.history(self.input_delays))

    def having(self, **changes: Any) -> Self:
        """These settings with others, as far as their kind has them."""
        own = {each.name for each in fields(self) if each.init}
        return replace(self, **{name: changes[name] for name in own & set(changes)})

    @property
    def radius(self) -> float | None:
        """Radius to which eigenvalues are clipped, if they are."""
        if self.stable is False:
            return None
        return STABLE_RADIUS if self.stable is True else float(self.stable)

    def input_map(self, given: TrainingRuns, window: int | None) -> InputMap:
        """Fit the input map to training runs that end where training ends.

        Observables of a model that follows its own surge are made of waves without look-ahead.
        """
        aligned, observed = None, NOTHING
        if self.alignment is not None:
            aligned = self.alignment.fit(*given, window)
        if self.observables:
            observed = Observed.fit(self.observables, given.runs, given.inputs, window)
        if aligned is None or aligned.settings.surge != "predicted":
            return InputMap(aligned, self.lead, observed)
        follows = Following.fit(aligned, given.runs, given.states, window, self.lead)
        return InputMap(aligned, observed=observed, follows=follows)

    @property
    def follows_surge(self) -> bool:
        """Whether waves are carried to the surge that the model predicts."""
        return self.alignment is not None and self.alignment.surge == "predicted"

    def needs(self, dt: float, encounter_period: float | None = None) -> Needs:
        """Samples that it asks of its runs.

        Parameters
        ----------
        dt : float
            Time step, s.
        encounter_period : float, optional
            Encounter period, s, in which carriers of a model that follows its surge count.

        Raises
        ------
        RequestError
            If an observable counts in encounter periods and does not state its own.
        """
        delayed = self.input_delays
        if encounter_period and self.follows_surge:
            delayed += round(BACK * encounter_period / dt)
        observed = Observed(self.observables, (), dt, ())
        maps = InputMap(lead=self.lead, observed=observed, reference=self.centre)
        return Needs(
            self.window or 1,
            # The carriers of a model that follows its surge read ahead in place of the map.
            max(
                self.state_reach,
                maps.history(delayed),
                (delayed + self.centre) * self.follows_surge,
            ),
            self.history == "inside",
            maps.around.ahead,
        )

    def to_json(self) -> Json:
        """Settings as JSON values."""
        content = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        if "readouts" in content:
            content["readouts"] = readouts_json(self.readouts)
        return plain({key: _written(each) for key, each in content.items()})

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Settings from JSON values; an unknown key or a value out of range raises an error."""
        check_keys(cls, content)
        with quiet():  # given when the settings were made
            return cls(**content)

    @classmethod
    def restore(cls, dataset: xr.Dataset) -> Any:
        """Rebuild the model that a file holds; it is equal to the last bit."""
        settings = cls.from_json(store.content(dataset, "settings"))
        return store.restored(cls.model, dataset, settings=settings)


def _written(value: Any) -> Any:
    """A setting as its file states it: a length as text, and what has settings as a table."""
    if isinstance(value, Length):
        return str(value)
    if isinstance(value, Prior):
        return prior_json(value)
    if isinstance(value, tuple):
        return [_written(each) for each in value]
    return store.table_of(value) if is_dataclass(value) else value
