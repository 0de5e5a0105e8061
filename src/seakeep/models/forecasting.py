"""Steps of a forecast: read the history, check it, label the result, say what a model is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import RequestError
from seakeep.models import labelled
from seakeep.models.identification import Scale
from seakeep.signals.time_axis import fixed, instant_text, span_text

if TYPE_CHECKING:
    from seakeep.models.alignment import FittedAlignment
    from seakeep.models.fitted_ensemble import HankelEnsemble
    from seakeep.models.model import HankelDMDcModel

__all__ = ["ForecastWindow", "label_forecast", "modes", "read_window", "summary"]

FloatArray = npt.NDArray[np.float64]

DIVERGED = 1e6
"""A free run is given up where a state is this many training SDs from where it began."""
PIECE = 2**18
"""Numbers that are looked at together, so that a long run takes little beside its result."""


DIVERGED_AT = "diverged at t = "
"""How the status of a free run that was given up begins."""


class Reader(Protocol):
    """What a forecast must know of a model, or of an ensemble, to read a run."""

    @property
    def dt(self) -> float: ...
    @property
    def state_labels(self) -> tuple[labelled.ChannelLabel, ...]: ...
    @property
    def input_labels(self) -> tuple[labelled.ChannelLabel, ...]: ...
    @property
    def states(self) -> list[str]: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def state_delays(self) -> int: ...
    @property
    def input_delays(self) -> int: ...
    @property
    def history_samples(self) -> int: ...


@dataclass(frozen=True, eq=False)
class ForecastWindow:
    """Measured samples that a forecast reads, and the instants it writes.

    Parameters
    ----------
    name : str
        The run.
    start : float
        Instant of the last measured state, s.
    state_history, input_history : ndarray, shape (history_samples, channel)
        Samples up to and including the start, physical units.
    input_future : ndarray, shape (steps − 1, Q)
        Inputs after the start.
    steps : int
        Number of instants forecast.
    time : Variable, shape (steps,)
        These instants.
    """

    name: str
    start: float
    state_history: FloatArray
    input_history: FloatArray
    input_future: FloatArray
    steps: int
    time: xr.Variable


def read_window(model: Reader, run: xr.Dataset, start: float, steps: int | None) -> ForecastWindow:
    """Cut what a forecast needs out of a run; arguments and errors as ``forecast``."""
    name = labelled.run_name(run, "the run")
    labelled.check_run(run, name)
    labelled.check_step(run, name, model.dt)
    labelled.check_units(run, model.state_labels + model.input_labels, name)
    time = np.asarray(run.variables["time"].values, dtype=float)
    at = labelled.nearest_sample(time, labelled.as_instant(start, "start"), name)
    needed = model.history_samples

    def told(instant: float) -> str:
        return instant_text(instant, model.dt)

    if at + 1 < needed:
        near = abs(float(start) - time[at]) <= 1e-6 * model.dt
        snapped = "" if near else f" (nearest sample {told(time[at])} s)"
        raise RequestError(
            f"start = {told(float(start))} s{snapped} leaves {at + 1} samples of history in "
            f"{name} and the model needs {needed} (the start included): {needed - at - 1} are "
            f"missing. Start at {told(time[0] + (needed - 1) * model.dt)} s or later."
        )
    available = time.size - 1 - at
    count = available if steps is None else steps
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
        raise RequestError(
            f"steps must be a positive integer; received {steps!r}"
            f"{' at the end of the run' if steps is None else ''}. It counts the instants after "
            "start."
        )
    count = int(count)
    # The last input needed is the one an instant before the last state.
    most = available + 1 if model.inputs else count
    if count > most:
        raise RequestError(
            f"{count} steps from {told(time[at])} s need the input up to "
            f"{told(time[at] + (count - 1) * model.dt)} s and {name} ends at {told(time[-1])} s. "
            f"At most {most} steps can be forecast from there."
        )
    first = at + 1 - needed
    history = slice(first, at + 1)
    inputs = slice(first, max(at + count, at + 1))
    x = labelled.channel_matrix(run, model.states, name, history)
    u = labelled.channel_matrix(run, model.inputs, name, inputs)
    for values, names, delays in (
        (x, model.states, model.state_delays),
        (u, model.inputs, model.input_delays),
    ):
        unread = needed - 1 - delays  # the other group reaches further back
        labelled.check_finite(values[unread:], names, name, first + unread, time)
    instants = time[at + 1 : at + 1 + count]
    beyond = time[-1] + model.dt * np.arange(1, count - instants.size + 1)
    attrs = dict(run.variables["time"].attrs) or {"units": "s", "long_name": "time"}
    return ForecastWindow(
        name=name,
        start=float(time[at]),
        state_history=x,
        input_history=u[:needed],
        input_future=u[needed:],
        steps=count,
        time=xr.Variable(("time",), np.concatenate([instants, beyond]), attrs),
    )


def check_arrays(
    model: HankelDMDcModel | HankelEnsemble,
    x_history: npt.ArrayLike,
    u_history: npt.ArrayLike,
    u_future: npt.ArrayLike,
    steps: int,
) -> tuple[FloatArray, FloatArray]:
    """Return the histories cut to (s+1, N) and (z + steps, Q); arguments as ``forecast_arrays``.

    Columns that have names (a pandas DataFrame, a DataArray) are taken by name.
    """
    if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or steps < 1:
        raise RequestError(f"steps must be a positive integer; received {steps!r}.")
    states, inputs = model.states, model.inputs
    s, z = model.state_delays, model.input_delays
    x = _finite("x_history", _rows("x_history", x_history, s + 1, states, "s + 1")[-s - 1 :])
    if not inputs:
        return x, np.zeros((int(steps), 0))
    u = _finite("u_history", _rows("u_history", u_history, z + 1, inputs, "z + 1")[-z - 1 :])
    future = np.zeros((0, len(inputs))) if np.size(u_future) == 0 else u_future
    after = _rows("u_future", future, int(steps) - 1, inputs, "steps − 1")
    return x, np.concatenate([u, _finite("u_future", after[: int(steps) - 1])])


def _rows(
    name: str, value: npt.ArrayLike, least: int, names: Sequence[str], meaning: str
) -> FloatArray:
    plain = _by_name(name, value, names)
    if np.iscomplexobj(plain):
        raise RequestError(f"{name} holds complex numbers; channels are real.")
    if np.ma.isMaskedArray(plain):
        plain = np.ma.filled(np.ma.asarray(plain, dtype=float), np.nan)
    try:
        array = np.asarray(plain, dtype=float)
    except (TypeError, ValueError) as error:
        raise RequestError(f"{name} is no array of numbers: {error}.") from None
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
    columns = getattr(table, "columns", None)
    if isinstance(table, xr.DataArray) and table.ndim == 2 and table.dims[1] in table.coords:
        columns = table.indexes[table.dims[1]]
    if columns is None or not all(isinstance(each, str) for each in columns):
        return value
    missing = [each for each in names if each not in list(columns)]
    if missing:
        raise RequestError(
            f"{name} has no column '{missing[0]}'; its columns: {', '.join(columns)}."
        )
    if isinstance(table, xr.DataArray):
        return table.sel({table.dims[1]: list(names)}).values
    return table[list(names)].to_numpy()


def _finite(name: str, needed: FloatArray) -> FloatArray:
    if not np.all(np.isfinite(needed)):
        raise RequestError(
            f"{name} holds {int(np.sum(~np.isfinite(needed)))} values that are not finite in the "
            f"{len(needed)} rows needed. Fill the gap first."
        )
    return needed


def cut_divergence(values: FloatArray, scale: Scale, begun: FloatArray) -> FloatArray:
    """NaN from the instant on at which a state is lost.

    Parameters
    ----------
    values : ndarray, shape (…, time, channel)
        Free runs, physical units; changed in place.
    scale : Scale
        Moments of the channels in training.
    begun : ndarray, shape (…, 1, channel) or (channel,)
        The measured states from which the runs began: distance is counted from them, because
        without standardisation a mean far from zero is no divergence.

    Returns
    -------
    ndarray
        `values`.
    """
    spread = np.where(scale.spread > 0, scale.spread, np.inf)
    length = max(1, PIECE // max(1, values[..., 0, :].size))
    before = np.zeros((*values.shape[:-2], 1), dtype=bool)
    for first in range(0, values.shape[-2], length):
        piece = values[..., first : first + length, :]
        kept = np.isfinite(piece) & (np.abs(piece - begun) <= DIVERGED * spread)
        lost = ~np.all(kept, axis=-1)
        lost[..., :1] |= before
        if np.any(lost):
            piece[np.logical_or.accumulate(lost, axis=-1)] = np.nan
            before = np.any(lost, axis=-1, keepdims=True)
    return values


def status_text(lost: int, time: FloatArray, dt: float) -> str:
    """What ``status`` says of a free run whose first lost instant is `lost`, or −1 for none."""
    return "ok" if lost < 0 else f"{DIVERGED_AT}{instant_text(time[lost], dt)} s"


def status_at_clock(status: str, clock: float) -> str:
    """The same status where time runs by a factor `clock`, as at full scale."""
    if not status.startswith(DIVERGED_AT):
        return status
    instant = status.removeprefix(DIVERGED_AT).removesuffix(" s")
    decimals = max(3, len(instant.partition(".")[2]))
    return f"{DIVERGED_AT}{fixed(clock * float(instant), decimals)} s"


def label_forecast(
    model: HankelDMDcModel, window: ForecastWindow, values: FloatArray
) -> xr.Dataset:
    """Dataset of a forecast of shape (steps, N), with units, spread in training, and status."""
    lost = np.flatnonzero(np.isnan(values).any(axis=1))
    status = status_text(int(lost[0]) if lost.size else -1, window.time.values, model.dt)
    variables = {
        label.name: (
            "time",
            values[:, column],
            {
                "units": label.units,
                "long_name": label.long_name,
                "training_std": float(model.state_scale.spread[column]),
            },
        )
        for column, label in enumerate(model.state_labels)
    }
    # The instants stand among the variables: given as coords, xarray would merge twice.
    return xr.Dataset(
        {"time": window.time, **variables},
        attrs={"run": window.name, "start": window.start, "status": status},
    )


def modes(eigenvalues: npt.NDArray[np.complex128], dt: float) -> xr.Dataset:
    """Modes of a discrete system from its eigenvalues; see ``HankelDMDcModel.modes``."""
    kept = eigenvalues[eigenvalues.imag >= 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = np.log(kept.astype(complex)) / dt
        natural = np.abs(poles)
        frequency = np.abs(poles.imag) / (2 * np.pi)
        # An eigenvalue of zero is gone after a step: overdamped, not undefined.
        oscillating = (natural > 0) & np.isfinite(natural)
        damping = np.where(oscillating, -poles.real / natural, 1.0)
        decay = np.where(poles.real < 0, -1.0 / poles.real, np.inf)
        period = np.where(frequency > 0, 1.0 / frequency, np.inf)
    table = {
        "eigenvalue": (kept, "1", "eigenvalue of the discrete system"),
        "modulus": (np.abs(kept), "1", "modulus of the eigenvalue"),
        "frequency": (frequency, "Hz", "damped frequency"),
        "natural_frequency": (natural / (2 * np.pi), "Hz", "natural frequency"),
        "period": (period, "s", "damped period"),
        "damping_ratio": (damping, "1", "damping ratio"),
        "decay_time": (decay, "s", "time to decay to 1/e"),
    }
    return xr.Dataset(
        {
            name: ("mode", values, {"units": units, "long_name": label})
            for name, (values, units, label) in table.items()
        }
    )


def counted(number: int, thing: str) -> str:
    """A number and a word, in the plural where it must be."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def summary(model: HankelDMDcModel) -> str:
    """Text of ``HankelDMDcModel.summary``."""
    settings, training = model.settings, model.training
    states, inputs = len(model.states), len(model.inputs)
    lines = [
        f"Hankel DMD with control: {counted(states, 'state')}, "
        f"{counted(inputs, 'input')}, dt {model.dt:g} s",
        f"  states        {', '.join(with_units(model.state_labels))}",
        f"  inputs        {', '.join(with_units(model.input_labels)) or 'none (autonomous)'}",
        f"  delays        {model.state_delays} of the states ({model.state_delays * model.dt:g} s),"
        f" {model.input_delays} of the inputs ({model.input_delays * model.dt:g} s)",
        f"  history       {model.history_samples} samples up to the start of a forecast",
        f"  regression    {_regression(model)}; delay rows "
        f"{'exact' if settings.delay_rows == 'exact' else 'regressed'}",
        *alignment_line(model.alignment),
        f"  training      {sum(training.columns)} snapshot pairs of "
        f"{counted(len(training.runs), 'run')}",
    ]
    lines += [
        f"    {name}: {columns} pairs, {span_text(first, stop, model.dt)}"
        for name, columns, first, stop in zip(
            training.runs, training.columns, training.first, training.stop, strict=True
        )
    ]
    radius = model.spectral_radius
    verdict = "stable" if radius < 1 else "UNSTABLE: long forecasts diverge"
    lines.append(f"  stability     spectral radius {radius:.6f} ({verdict})")
    table = model.modes()
    for mode in range(min(5, table.sizes["mode"])):
        at = table.isel(mode=mode)
        lines.append(
            f"    mode {mode + 1}: {float(at.natural_frequency):.4g} Hz, damping ratio "
            f"{float(at.damping_ratio):.3g}, |eigenvalue| {float(at.modulus):.6f}"
        )
    return "\n".join(lines)


def with_units(labels: tuple[labelled.ChannelLabel, ...]) -> list[str]:
    """Names of channels with their units."""
    return [f"{label.name} [{label.units or '?'}]" for label in labels]


def alignment_line(alignment: FittedAlignment | None) -> list[str]:
    """Line of a summary that says how the input is aligned; none without an alignment."""
    if alignment is None:
        return []
    speed = "" if alignment.celerity is None else f", celerity {alignment.celerity:.4g} m/s"
    settings = alignment.settings
    return [f"  alignment     mode {settings.mode}{speed}; surge {settings.surge}"]


def _regression(model: HankelDMDcModel) -> str:
    training = model.training
    if model.settings.rank is not None:
        return f"truncated SVD of rank {training.rank}"
    form = {"primal": "primal form", "dual": "dual form", "svd": "singular values"}
    per = ""
    if model.settings.ridge_scale == "per_snapshot":
        per = f" ({model.settings.ridge:g} a snapshot pair)"
    return f"ridge {training.ridge:g}{per}, {form[training.method]}"
