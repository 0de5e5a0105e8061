"""What a model is (Model, Spec), and its forecasts.

Their names, units, status, statistics of members and weight; the door for arrays.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import (
    TINY,
    BoolArray,
    FloatArray,
    IntArray,
    Json,
    Progress,
    as_real,
    check_choice,
    fraction,
    whole_number,
)
from seakeep.errors import RequestError, warn
from seakeep.files import write_sealed
from seakeep.models import engine, store
from seakeep.models.alignment import FittedAlignment, ProbeAlignment
from seakeep.models.engine import Series, Windows, first_lost
from seakeep.models.growth import LeadErrors
from seakeep.models.inputs import Scale, Signature
from seakeep.models.labelled import ChannelLabel, Runs, Stop, channel_matrix
from seakeep.models.settings import Needs, Role
from seakeep.models.training import Training
from seakeep.models.validity import Coverage, outside_training
from seakeep.signals.prediction import fill_future
from seakeep.signals.time_axis import instant_text, span_text

STATISTICS = ("mean", "std", "lower", "upper")
CHUNK = 8 * 2**20
"""Bytes of all members that are reduced at a time."""
DOUBTED = 0.5, 0.9
"""Squares of errors, claimed, over the variance of training between which a forecast from waves
that are predicted passes over to the mean: on the virtual tank its best weight is 0.7 to 0.9 at
0.55, 0.2 to 0.5 at 0.75 and 0 to 0.1 at 0.95, by one probe and by two."""


class Model:
    """A fitted model: here of one member, and an ensemble says what differs.

    It adds a signature, settings, ``training``, ``coverage``, ``free_runs``, ``summary`` and
    ``to_dataset``.
    """

    signature: Signature
    settings: Any
    training: Training
    coverage: Coverage

    @property
    def kind(self) -> str:
        """Word of its spec in TOML files and in :data:`seakeep.models.registry.KINDS`."""
        return self.settings.kind

    @property
    def n_members(self) -> int:
        """Number of members."""
        return 1

    @property
    def is_centred(self) -> bool:
        """Whether the mean of the members is the forecast of a single model of all runs."""
        return False

    @property
    def dt(self) -> float:
        """Time step, s."""
        return self.signature.dt

    @property
    def states(self) -> list[str]:
        """Names of the states, in the order of the model."""
        return list(self.signature.states)

    @property
    def inputs(self) -> list[str]:
        """Names of the measured inputs, in the order of the model."""
        return list(self.signature.inputs)

    @property
    def regressors(self) -> list[str]:
        """Names of what the inputs become: the delayed regressors, then the direct ones."""
        return self.signature.regressors

    @property
    def state_labels(self) -> tuple[ChannelLabel, ...]:
        """Names, units and long names of the states."""
        return self.signature.state_labels

    @property
    def input_labels(self) -> tuple[ChannelLabel, ...]:
        """Names, units and long names of the measured inputs."""
        return self.signature.input_labels

    @property
    def state_delays(self) -> int:
        """Number of delayed copies of the states, s; the longest of a member."""
        return self.signature.state_delays

    @property
    def input_delays(self) -> int:
        """Number of delayed copies of the inputs, z; the longest of a member."""
        return self.signature.input_delays

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, that one included, for the longest delays."""
        return self.signature.history_samples

    @property
    def lead_samples(self) -> int:
        """Samples of input after the one a step starts from that drive the step."""
        return self.signature.lead_samples

    @property
    def alignment(self) -> FittedAlignment | None:
        """How the wave input is aligned to the vessel, as completed from the training runs."""
        return self.signature.input_map.alignment

    def free_runs(
        self, groups: Sequence[Windows], members: Sequence[int] = (0,)
    ) -> list[FloatArray]:
        """Free runs over groups of windows, each (1, window, steps, N), NaN from where lost."""
        raise NotImplementedError

    def read_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int | None,
        ahead: str = "refuse",
        name: str = "the run",
    ) -> Windows:
        """What forecasts from several starts in one run read; `name` is that of a run without."""
        if np.ndim(starts) == 0:
            raise RequestError(
                f"starts must be a list of instants; received {starts!r}. Write [{starts}]."
            )
        places = [(name, start) for start in starts]
        return engine.read_groups(self.signature, {name: run}, [(places, steps)], ahead)[0]

    def judged_starts(self, run: xr.Dataset, steps: int, first: int = 0) -> range:
        """Samples from which windows end to end can be forecast in a run, from `first` on."""
        last = run.sizes["time"] - steps - self.signature.input_after
        return range(max(first, self.history_samples - 1), last, steps)

    def judged_runs(
        self, run: xr.Dataset, name: str, starts: Sequence[int], steps: int
    ) -> tuple[FloatArray, FloatArray]:
        """Free runs from samples of a run, and the measurement, each (window, steps, N).

        Of an ensemble the members' mean.
        """
        time = run["time"].values
        windows = self.read_windows(run, time[list(starts)].tolist(), steps, name=name)
        states = channel_matrix(run, self.states, name)
        measured = np.stack([states[at + 1 : at + 1 + steps] for at in starts])
        return self._series(windows, None, None)[0].mean(axis=0), measured

    def summary(self) -> str:
        """Text that says what the model is."""
        raise NotImplementedError

    def to_dataset(self) -> xr.Dataset:
        """The model as a Dataset: what :meth:`save` writes."""
        return store.packed(self)

    def save(self, path: str | Path) -> Path:
        """Write the model as NetCDF, to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File; another model there is replaced.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_model` reads it, running no code from it.

        Raises
        ------
        RequestError
            If the file cannot be written, or another one than a model is there.
        """
        return write_sealed(
            self.to_dataset().assign_attrs(seakeep_kind=self.kind), path, store.MODEL
        )

    def _repr_html_(self) -> str:
        """Summary, for notebooks."""
        return f'<pre style="white-space: pre-wrap">{escape(self.summary())}</pre>'

    @property
    def training_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant of the training window of each run, s."""
        training = self.training
        spans = zip(training.first, training.stop, strict=True)
        return dict(zip(training.runs, spans, strict=True))

    def lines(self, regression: str = "") -> list[str]:
        """Lines of a summary: channels, delays, history, regression, input map and training."""
        signature, training, dt = self.signature, self.training, self.dt
        states, inputs = (
            ", ".join(with_units(labels))
            for labels in (signature.state_labels, signature.input_labels)
        )
        return [
            f"  states        {states}",
            f"  inputs        {inputs or 'none (autonomous)'}",
            f"  delays        {self.state_delays} of the states ({self.state_delays * dt:g} s),"
            f" {self.input_delays} of the inputs ({self.input_delays * dt:g} s)",
            f"  history       {self.history_samples} samples up to the start of a forecast",
            *([f"  regression    {regression}"] if regression else []),
            *signature.input_map.describe(dt),
            *(each.describe() for each in signature.readouts),
            f"  training      {sum(training.columns)} snapshot pairs of "
            f"{counted(len(training.runs), 'run')}",
            *(
                f"    {name}: {columns} pairs, {span_text(*self.training_spans[name], dt)}"
                for name, columns in zip(training.runs, training.columns, strict=True)
            ),
        ]

    def forecast(
        self, run: xr.Dataset, start: float, steps: int | None = None, *, ahead: str = "refuse"
    ) -> xr.Dataset:
        """Free run driven by the measured input of `run`.

        States are read up to `start` and not after; inputs up to the instant before the last, and
        as much later as the model looks ahead (``attrs["reads_input_until"]``). The one exception
        is an alignment with ``surge="measured"``: it reads the surge after `start` too, and writes
        ``conditional_on`` into the result's attributes.

        Parameters
        ----------
        run : Dataset
            Channels of the model over ``time``, in any order; other channels are ignored.
        start : float
            Instant of the last measured state, s; the nearest sample is taken. The
            ``history_samples`` samples up to it are needed.
        steps : int, optional
            Number of instants forecast; by default to the end of the run.
        ahead : {"refuse", "predict"}, optional
            What to do if the input ends before the look-ahead: refuse, or predict it as
            ``live().forecast`` does, from its record by linear prediction
            (:func:`seakeep.signals.predict_waves`), and from what probes up-wave have seen where
            positions and depth are known. Samples missing after `start` count as not recorded.
            As the error that is expected comes near the SD of training, the forecast of a model
            that holds its errors, or the mean of an ensemble, tends to the mean there.

        Returns
        -------
        Dataset
            States at the `steps` instants after `start`, with units; ``attrs["start"]`` is the
            instant taken, ``attrs["status"]`` "ok" or from when on the forecast diverged (NaN
            from there; also ``attrs["diverged_at"]``, s), ``attrs["reads_input_until"]`` how long
            after the last instant the last input that was read lies, s: negative where it lies
            before. Where input was predicted, the status says ", input predicted from t = … s",
            the first instant that depends on it, which ``attrs["input_predicted_from"]`` holds too.
            Where waves, means of inputs or drift lie outside the training, it ends in ", outside
            training", and ``attrs["outside_training"]`` says by how much: period, height,
            steepness, mean of an input, mean surge.

        Raises
        ------
        RequestError
            If a channel is missing, or `start` and `steps` do not fit the run.
        DataError
            If the step or the units are not the model's, or needed samples are missing.
        """
        windows, signature = self.read_windows(run, [start], steps, ahead), self.signature
        (values,) = self.free_runs([windows])[0][0]
        _warn_of_reach(signature, windows, values)
        variables = label_channels(signature, values, ("time",))
        attrs = forecast_attrs(self, run, windows, values, int(first_lost(values)))
        # The instants stand among the variables: given as coords, xarray would merge twice.
        return xr.Dataset({"time": windows.time[0], **variables}, attrs=attrs)

    def forecast_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        *,
        ahead: str = "refuse",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Free runs from several starts, side by side: much faster than one after the other.

        Parameters
        ----------
        run, steps, ahead
            As in :meth:`forecast`; `steps` holds for all.
        starts : sequence of float
            Instants of the last measured state, s.
        executor, progress
            As in :meth:`HankelEnsemble.forecast`; one model has no work to share.

        Returns
        -------
        Dataset
            States with dimensions (window, lead), of an ensemble (window, member, lead), ``lead``
            in s after each ``start`` (over ``window``), and ``status`` over ``window``, of an
            ensemble over (window, member); with predicted input also ``input_predicted_from``
            over ``window``, NaN where it is all measured.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`, or if there is no start.
        """
        windows = self.read_windows(run, starts, steps, ahead)
        series, lost = self._series(windows, executor, progress)
        values, status = np.array(series).swapaxes(0, 1), statuses(lost, windows, self.dt).T
        return self._of_members(
            windows_dataset(
                self.signature, windows, values, "member", status=(("window", "member"), status)
            )
        )

    def _series(
        self, windows: Windows, executor: Executor | None, progress: Progress | None
    ) -> Series:
        """Series of all members, as :func:`seakeep.models.engine.member_series`."""
        return engine.member_series(self, [windows], executor, progress)[0]

    def _of_members(self, forecast: xr.Dataset) -> xr.Dataset:
        """A forecast of all members: of one alone, without their dimension."""
        return forecast.isel(member=0)


class Spec(Protocol):
    """Settings that are fitted to runs; frozen, with JSON values.

    Attributes
    ----------
    kind : str
        Its word in TOML files and in :data:`seakeep.models.registry.KINDS`.
    role : {"model", "reference"}
        Whether it is to be judged, or is what others are compared with.
    is_ensemble : bool
        Whether what it fits has several members.
    """

    kind: ClassVar[str]
    role: ClassVar[Role]
    is_ensemble: ClassVar[bool]

    @property
    def n_members(self) -> int:
        """Number of members."""

    @property
    def standardize(self) -> bool:
        """Whether channels are centred and scaled."""

    @property
    def alignment(self) -> ProbeAlignment | None:
        """How measured waves are carried to the vessel."""

    def resolved(self, dt: float, encounter_period: float | None) -> Self:
        """Settings whose lengths are samples."""

    def needs(self, dt: float, encounter_period: float | None = None) -> Needs:
        """Samples that it asks of its runs at a time step and an encounter period, s."""

    def fit(
        self, runs: Runs, states: Sequence[str], inputs: Sequence[str], stop: Stop = None
    ) -> Model:
        """Identify a model from training runs."""

    def to_json(self) -> Json:
        """Settings as JSON values."""

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Settings from JSON values; unknown or missing ones raise an error."""

    @classmethod
    def restore(cls, dataset: xr.Dataset) -> Model:
        """Rebuild the model that a file holds."""


def forecast_attrs(
    model: Model,
    run: xr.Dataset,
    windows: Windows,
    values: FloatArray,
    lost: int = -1,
    **facts: Any,
) -> dict[str, Any]:
    """Attributes of a forecast from one start, shape (…, steps, N), and facts of its runs.

    A single run is `lost` from that instant on, or −1.
    """
    signature, (_, start) = model.signature, windows.places[0]
    names = signature.states
    surge = values[..., names.index("surge")] if "surge" in names else None
    if reasons := outside_training(model, run, start, windows.steps, surge):
        facts["outside_training"] = "; ".join(reasons)
    attrs = {**windows.notes, "start": start, **outcome(windows, 0, lost), **facts}
    return {**attrs, "status": status_text(attrs, signature.dt)}


def _warn_of_reach(signature: Signature, windows: Windows, values: FloatArray) -> None:
    """Warn where a vessel leaves the places at which its waves are known."""
    if (follows := signature.input_map.follows) is None:
        return
    low, high = follows.reach
    known = windows.histories[0, :, follows.column]
    surge = np.concatenate([known, values[:, follows.column]])
    places = follows.place.of(surge)[-len(values) :]
    beyond = np.flatnonzero((places <= low) | (places >= high))
    if beyond.size:
        instant = instant_text(windows.time[0].values[beyond[0]], signature.dt)
        trained, far = follows.place.grid[follows.trained], places[beyond]
        drifts = far.min() < trained[0] or far.max() > trained[-1]
        longer = "Train on runs that drift as far, read" if drifts else "Read"
        warn(
            f"{windows.places[0][0]}: from t = {instant} s on the slow surge of the forecast lies "
            f"beyond {low:.3g} to {high:.3g} m, where the carriers know the waves. {longer} "
            "further ahead (lead), or add a probe up-wave."
        )


def label_channels(
    signature: Signature, values: FloatArray, dims: tuple[str, ...]
) -> dict[str, Any]:
    """Variables of values of shape (…, N), with units and spread in training."""
    spread = signature.state_scale.spread.tolist()
    return {
        label.name: (
            dims,
            values[..., column],
            {
                "units": label.units,
                "long_name": label.long_name,
                "training_std": spread[column],
            },
        )
        for column, label in enumerate(signature.state_labels)
    }


def windows_dataset(
    signature: Signature, windows: Windows, values: FloatArray, inner: str, **more: Any
) -> xr.Dataset:
    """Forecasts from several starts, shape (window, inner, lead, N), and more variables."""
    lead = signature.dt * np.arange(1, windows.steps + 1)
    starts = [start for _, start in windows.places]
    coords = {
        "start": ("window", starts, {"units": "s", "long_name": "start"}),
        "lead": ("lead", lead, {"units": "s", "long_name": "time after start"}),
    }
    if max(windows.predicted) >= 0:
        instants = [
            outcome(windows, each).get("input_predicted_from", np.nan)
            for each in range(len(starts))
        ]
        words = {"units": "s", "long_name": "first instant that depends on predicted input"}
        coords["input_predicted_from"] = ("window", instants, words)
    variables = label_channels(signature, values, ("window", inner, "lead"))
    notes = {**windows.notes, **(outcome(windows, 0) if len(starts) == 1 else {})}
    return xr.Dataset(variables | more, coords=coords, attrs=notes)


def outcome(windows: Windows, window: int, lost: int = -1) -> dict[str, float]:
    """Instants that the status of a free run names, s; `lost` is its first lost one, or −1."""
    places = {"diverged_at": lost, "input_predicted_from": windows.predicted[window]}
    time = windows.time[window].values
    return {name: float(time[at]) for name, at in places.items() if at >= 0}


def status_text(facts: Mapping[str, Any], dt: float) -> str:
    """Text of ``status``.

    Parameters
    ----------
    facts : mapping
        What :func:`outcome` found, and ``outside_training``; of an ensemble, how many of its
        ``members`` ``diverged``.
    dt : float
        Time step, s.
    """
    said = "ok"
    if "diverged_at" in facts:
        said = f"diverged at t = {instant_text(facts['diverged_at'], dt)} s"
    elif facts.get("diverged"):
        said = f"{facts['diverged']} of {facts['members']} members diverged"
    if "input_predicted_from" in facts:
        instant = instant_text(facts["input_predicted_from"], dt)
        said += f", input predicted from t = {instant} s"
    return said + ", outside training" * ("outside_training" in facts)


def statuses(lost: IntArray, windows: Windows, dt: float) -> npt.NDArray[np.str_]:
    """Status from the first lost instants, or −1, shape (member, window)."""
    texts = [
        [status_text(outcome(windows, window, int(at)), dt) for window, at in enumerate(row)]
        for row in lost
    ]
    return np.array(texts, dtype=str)


def counted(number: int, thing: str) -> str:
    """A number and a word, in the plural where it must be."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def with_units(labels: tuple[ChannelLabel, ...]) -> list[str]:
    """Names of channels with their units."""
    return [f"{label.name} [{label.units or '?'}]" for label in labels]


def check_arrays(
    signature: Signature,
    x_history: npt.ArrayLike,
    u_history: npt.ArrayLike,
    u_future: npt.ArrayLike,
    steps: int,
    ahead: str = "refuse",
) -> Windows:
    """Windows of plain arrays; arguments as ``forecast_arrays``.

    Columns that have names (a pandas DataFrame, a DataArray) are taken by name.
    """
    count = whole_number(steps, "steps")
    check_choice("ahead", ahead, ("refuse", "predict"))
    states, inputs = signature.states, signature.inputs
    rows, z = signature.state_samples, signature.input_history
    meaning = (
        "s + 1" if rows == signature.state_delays + 1 else "the surge before the delayed waves"
    )
    x = _finite("x_history", rows_by_name("x_history", x_history, rows, states, meaning)[-rows:])
    if not inputs:
        return engine.array_windows(signature, x[None], np.zeros((1, z + count, 0)), count)
    past = rows_by_name("u_history", u_history, z + 1, inputs, "z + 1")
    _finite("u_history", past[-z - 1 :])
    future = u_future if as_real(u_future, "u_future").size else np.zeros((0, len(inputs)))
    needed = count - 1 + signature.lead_samples
    meaning = "steps − 1 + lead_samples" if signature.lead_samples else "steps − 1"
    least = needed if ahead == "refuse" else 0
    after = _finite("u_future", rows_by_name("u_future", future, least, inputs, meaning)[:needed])
    whole, first = np.concatenate([past, after]), -1
    futures = whole[None]
    if missing := needed - len(after):
        _finite("u_history", past)
        whole = np.pad(whole, ((0, missing), (0, 0)), constant_values=np.nan)
        futures, *_ = fill_future(whole, len(past), engine.foresight(signature))
        first = max(len(after) - signature.lead_samples + 1, 0)
    windows, *departures = (
        engine.array_windows(signature, x[None], each[None, -z - 1 - needed :], count)
        for each in futures
    )
    return replace(windows, departures=tuple(departures), predicted=(first,))


def rows_by_name(
    name: str, value: npt.ArrayLike, least: int, names: Sequence[str], meaning: str
) -> FloatArray:
    """Rows of numbers (time, channel); columns that have names are taken by name."""
    array = as_real(_by_name(name, value, names), name)
    channels = len(names)
    if array.ndim != 2 or array.shape[1] != channels or array.shape[0] < least:
        turned = array.ndim == 2 and array.shape[0] == channels and array.shape[1] >= least
        raise RequestError(
            f"{name} has shape {array.shape}; expected (time, channel) with at least {least} rows "
            f"({meaning}) and {channels} columns.{' It looks transposed.' if turned else ''}"
        )
    return array


def _by_name(name: str, value: npt.ArrayLike, names: Sequence[str]) -> Any:
    """Columns in the order of the model, where they have names."""
    table: Any = value
    if isinstance(table, xr.DataArray) and table.ndim == 2:
        table = table.to_pandas()
    columns = getattr(table, "columns", None)
    if columns is None or not all(isinstance(each, str) for each in columns):
        return value
    missing = [each for each in names if each not in list(columns)]
    if missing:
        raise RequestError(
            f"{name} has no column '{missing[0]}'; its columns: {', '.join(columns)}."
        )
    return table[list(names)].to_numpy()


def _finite(name: str, needed: FloatArray) -> FloatArray:
    if not np.all(np.isfinite(needed)):
        raise RequestError(
            f"{name} holds {int(np.sum(~np.isfinite(needed)))} values that are not finite in the "
            f"{len(needed)} rows needed. Fill the gap first."
        )
    return needed


def statistics_of(values: FloatArray, level: float) -> FloatArray:
    """Statistics over the first axis.

    Parameters
    ----------
    values : ndarray, shape (member, …)
        Members.
    level : float
        Probability between the two quantiles.

    Returns
    -------
    ndarray, shape (4, …)
        Mean, standard deviation (ddof = 1; zero for one member) and the quantiles
        (1 ∓ `level`)/2, exact with linear interpolation between order statistics. NaN without
        members.
    """
    out = np.full((4, *values.shape[1:]), np.nan)
    if not len(values):
        return out
    out[0] = values.mean(axis=0)
    out[1] = values.std(axis=0, ddof=1) if len(values) > 1 else 0.0
    probabilities = 0.5 - level / 2, 0.5 + level / 2
    # As numpy.quantile gives them to the last bit, from the nearer of two, in a fraction of the
    # time for the members that an ensemble has.
    ordered, last = np.sort(values, axis=0), len(values) - 1
    for row, probability in zip(out[2:], probabilities, strict=True):
        below = int(probability * last)
        part = probability * last - below
        low, high = ordered[below], ordered[min(below + 1, last)]
        row[:] = low + part * (high - low) if part < 0.5 else high - (1.0 - part) * (high - low)
    return out


def statistic_coordinate(level: float, bounds: str = "") -> xr.Variable:
    """Coordinate of the statistics, which says what the bounds of the band are."""
    bounds = bounds or f"the quantiles {0.5 - level / 2:g} and {0.5 + level / 2:g} of the members"
    attrs = {
        "long_name": "statistic over the members",
        "comment": f"lower and upper are {bounds}; members that diverged are left out of all four",
    }
    return xr.Variable(("statistic",), list(STATISTICS), attrs)


def reduce_members(series: FloatArray, lost: IntArray, level: float) -> FloatArray:
    """Reduce members to statistics, piece by piece in time.

    A member that is lost (NaN) anywhere in a window is left out of that window's statistics from
    its first instant on: what is left of it would weigh in one part of the band and not in the
    other.

    Parameters
    ----------
    series : ndarray, shape (member, window, steps, N)
        Series of the members, from :func:`seakeep.models.engine.member_series`.
    lost : ndarray of int, shape (member, window)
        First instant lost, or −1.
    level : float
        Probability between the two quantiles.

    Returns
    -------
    ndarray, shape (window, 4, steps, N)
        As :func:`statistics_of`.
    """
    members, windows, steps, channels = series.shape
    out = np.empty((windows, 4, steps, channels))
    length = max(1, CHUNK // (8 * members * channels))
    for window in range(windows):
        complete = np.flatnonzero(lost[:, window] < 0)
        for first in range(0, steps, length):
            piece = slice(first, first + length)
            out[window, :, piece] = statistics_of(
                np.asarray(series[complete, window, piece]), level
            )
    return out


def summarize(forecast: xr.Dataset, level: float = 0.95) -> xr.Dataset:
    """Mean, standard deviation and band of an ensemble forecast.

    Parameters
    ----------
    forecast : Dataset
        With the dimension ``member``, from ``forecast`` of an ensemble.
    level : float, optional
        Probability between ``lower`` and ``upper``.

    Returns
    -------
    Dataset
        The variables of `forecast` with ``statistic`` (mean, std, lower, upper) instead of
        ``member``. Members that diverged are left out of all instants; ``attrs["members"]`` and
        ``attrs["diverged"]`` count them.

    Raises
    ------
    RequestError
        If `level` is not between 0 and 1.

    Examples
    --------
    >>> import xarray as xr
    >>> two = xr.Dataset({"heave": (("member", "time"), [[1.0, 2.0], [3.0, 4.0]])})
    >>> summarize(two).heave.sel(statistic="mean").values
    array([2., 3.])
    """
    level = fraction(level, "level")
    windows = forecast if "window" in forecast.dims else forecast.expand_dims("window")
    channels = {
        name: variable.transpose("member", "window", ...)
        for name, variable in windows.data_vars.items()
        if "member" in variable.dims and variable.dtype.kind in "iuf"
    }
    lost, variables = np.zeros((forecast.sizes["member"], windows.sizes["window"]), bool), {}
    for each in channels.values():
        lost |= np.isnan(each.values).any(axis=tuple(range(2, each.ndim)))
    for name, each in channels.items():
        series = each.values.reshape(*lost.shape, -1, 1)
        values = reduce_members(series, np.where(lost, 0, -1), level)
        values = values.reshape(lost.shape[1], len(STATISTICS), *each.shape[2:])
        variable = xr.Variable(("window", "statistic", *each.dims[2:]), values, each.attrs)
        variables[name] = variable if "window" in forecast.dims else variable[0]
    summary = xr.Dataset(variables, forecast.drop_dims("member").coords, forecast.attrs)
    return summary.assign_coords(statistic=statistic_coordinate(level)).assign_attrs(
        level=level, members=len(lost), diverged=int(lost.sum())
    )


def weighed_runs(
    model: Any, run: Callable[[Sequence[Windows]], list[FloatArray]], groups: Sequence[Windows]
) -> list[FloatArray]:
    """Free runs of a single model over groups of windows, weighed where waves are predicted."""
    runs = run(groups)
    for values, windows in zip(runs, groups, strict=True):
        if windows.departures and model.errors is not None:
            parts = [values, *run(windows.departures)]
            weigh_members(windows, parts, model.errors, model.signature.state_scale)
    return runs


def weighed(
    runs: FloatArray,
    errors: FloatArray | float,
    scale: Scale,
    given: BoolArray,
    before: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of runs that passes over to that of training as the claimed error nears the SD there.

    Where a state lies farther than the SD to one side of that mean all through the history, as the
    mean surge of another sea does, the mean errs by more: by what the forecast departs, too.

    Parameters
    ----------
    runs : ndarray, shape (member, 1 + 2 departures, …, steps, N)
        Runs from the inputs that are expected, then from departures from them and from their
        opposites. Innovations of later samples do the same later, so that effects add up over the
        leads: what squares of waves move the mean by, and the variance. Inputs may depart by the
        same waves, so that effects of one innovation of each count with one sign. Steps before
        those of `given` only add up.
    errors : ndarray, shape (steps, N)
        Mean squares of the model's errors.
    scale : Scale
        Moments of training.
    given : ndarray of bool, shape (…, steps)
        Whether the waves that a step reads are known: nothing changes there.
    before : ndarray, shape (N,)
        The :func:`departure` of the history.

    Returns
    -------
    mean, spread, weight : ndarray, shape (…, steps, N)
        The mean; the variance over members and waves, before it is weighed; and the weight of the
        forecast against the mean of training.
    """
    late = runs.shape[-2] - given.shape[-1]
    middle, (plus, minus) = runs[:, 0], np.split(runs[:, 1:], 2, axis=1)
    apart = 0.5 * np.abs(plus - minus).sum(axis=1)
    moved = (0.5 * (plus + minus) - middle[:, None]).sum(axis=1)
    spread: FloatArray = np.cumsum(np.mean(apart**2, axis=0), axis=-2)[..., late:, :]
    away = np.nan_to_num(np.cumsum(moved.mean(axis=0), axis=-2))[..., late:, :]
    middle = middle[..., late:, :]
    if len(middle) > 1:
        spread += middle.var(axis=0, ddof=1)
    low, high = DOUBTED
    known, mean, centre = given[..., None], middle.mean(axis=0), scale.centre
    # A state that never moved is as it is.
    usual = np.fmax(np.fmin(np.abs(mean - centre), before), scale.spread)
    claimed = (spread + errors) / np.maximum(usual**2, TINY)
    # Where a departure is lost, nothing of the forecast is trusted.
    trust = np.nan_to_num((high - claimed) / (high - low), nan=0.0)
    lasting = np.minimum.accumulate(np.clip(trust, 0.0, 1.0), axis=-2)
    shrunk = centre + lasting * (mean + away - centre)
    return np.where(known, mean, shrunk), spread, np.where(known, 1.0, lasting)


def departure(history: FloatArray, scale: Scale) -> FloatArray:
    """How far all of a history lies to one side of the mean of training, shape (N,)."""
    away = history - scale.centre
    return np.maximum(away.min(axis=0), -away.max(axis=0))


def weigh_members(
    windows: Windows, parts: Sequence[FloatArray], errors: LeadErrors, scale: Scale
) -> None:
    """Weigh members in place where windows read predicted inputs, and keep their spread.

    Parameters
    ----------
    windows : Windows
        With their departures.
    parts : sequence of ndarray, each of shape (member, window, steps, N)
        Runs over the windows, which are changed, and over the departures. A member that is lost in
        a window does not count there, unless all are.
    errors : LeadErrors
        Errors of the members' mean.
    scale : Scale
        Moments of training.
    """
    steps, squares = np.arange(windows.steps), errors.of_forecast(windows.steps)
    for number, first in enumerate(windows.predicted):
        whole = np.isfinite(parts[0][:, number]).all(axis=(1, 2))
        whole |= not whole.any()
        own, before = scale, departure(windows.histories[number], scale)
        if windows.zero is not None:
            own = replace(scale, centre=scale.centre + windows.zero[number])
        for column in range(squares.shape[1] if first >= 0 else 0):  # one by one, for memory
            at = slice(column, column + 1)
            runs = np.stack([each[whole, number, :, at] for each in parts], axis=1)
            mean, *_ = weighed(runs, squares[:, at], own.part(at), steps < first, before[at])
            parts[0][:, number, :, at] += mean - runs[:, 0].mean(axis=0)
