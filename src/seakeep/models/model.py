"""An identified model: forecast, stability, export, and its file."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import SeakeepWarning
from seakeep.models import aligned, export, forecasting, store
from seakeep.models.alignment import FittedAlignment
from seakeep.models.identification import Scale
from seakeep.models.labelled import ChannelLabel
from seakeep.models.settings import HankelSettings
from seakeep.models.training import Training
from seakeep.models.windows import forecast_windows, free_runs

if TYPE_CHECKING:
    import control
    from scipy import signal

__all__ = ["HankelDMDcModel"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HankelDMDcModel:
    """An identified model; made by :meth:`HankelDMDc.fit` or :func:`seakeep.load_model`.

    Parameters
    ----------
    settings : HankelSettings
        The settings it was identified with.
    coefficients : ndarray, shape (N(s+1) or N, N(s+1) + Q(z+1))
        Regressed rows of [Â B̂], on standardised deviations.
    dt : float
        Time step, s.
    state_labels, input_labels : tuple of ChannelLabel
        Names and units of states and inputs.
    state_scale, input_scale : Scale
        Means and standard deviations.
    training : Training
        Runs, windows and form of the regression.
    alignment : FittedAlignment, optional
        How the wave input is aligned to the vessel, as completed from the training runs.
    """

    settings: HankelSettings
    coefficients: FloatArray = field(repr=False)
    dt: float
    state_labels: tuple[ChannelLabel, ...]
    input_labels: tuple[ChannelLabel, ...]
    state_scale: Scale = field(repr=False)
    input_scale: Scale = field(repr=False)
    training: Training
    alignment: FittedAlignment | None = None

    def __post_init__(self) -> None:
        scales = (self.state_scale, self.input_scale)
        for array in (self.coefficients, *(a for s in scales for a in (s.mean, s.std, s.spread))):
            array.flags.writeable = False

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(states={self.states}, inputs={self.inputs}, "
            f"state_delays={self.state_delays}, input_delays={self.input_delays}, "
            f"dt={self.dt:g}; print(model.summary()) says more)"
        )

    @property
    def states(self) -> list[str]:
        """Names of the states, in the order of the model."""
        return [label.name for label in self.state_labels]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs, in the order of the model."""
        return [label.name for label in self.input_labels]

    @property
    def state_delays(self) -> int:
        """Number of delayed copies of the states, s."""
        return self.settings.state_delays

    @property
    def input_delays(self) -> int:
        """Number of delayed copies of the inputs, z."""
        return self.settings.input_delays

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, that one included: max(s, z) + 1."""
        return self.settings.history_samples

    @property
    def state_mean(self) -> FloatArray:
        """What is subtracted from the states, shape (N,)."""
        return self.state_scale.mean

    @property
    def state_std(self) -> FloatArray:
        """What the states are divided by, shape (N,)."""
        return self.state_scale.std

    @property
    def input_mean(self) -> FloatArray:
        """What is subtracted from the inputs, shape (Q,)."""
        return self.input_scale.mean

    @property
    def input_std(self) -> FloatArray:
        """What the inputs are divided by, shape (Q,)."""
        return self.input_scale.std

    @property
    def training_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant of the training window of each run, s."""
        training = self.training
        return dict(
            zip(training.runs, zip(training.first, training.stop, strict=True), strict=True)
        )

    @property
    def top(self) -> tuple[FloatArray, FloatArray]:
        """Regressed rows of Â and B̂: N of them with exact delay rows, else all."""
        size = len(self.state_labels) * (self.state_delays + 1)
        return self.coefficients[:, :size], self.coefficients[:, size:]

    @cached_property
    def A(self) -> FloatArray:
        """Â, shape (N(s+1), N(s+1)), on standardised deviations, newest block first."""
        a = self.top[0].astype(float, copy=False)
        size, count = a.shape[1], len(self.state_labels)
        if a.shape[0] == size:
            return _read_only(a)
        return _read_only(np.concatenate([a, np.eye(size - count, size)]))

    @cached_property
    def B(self) -> FloatArray:
        """B̂, shape (N(s+1), Q(z+1)), on standardised deviations, newest block first."""
        b = self.top[1].astype(float, copy=False)
        missing = self.A.shape[0] - b.shape[0]
        return _read_only(np.concatenate([b, np.zeros((missing, b.shape[1]))]))

    @cached_property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of Â, largest modulus first.

        Warns
        -----
        SeakeepWarning
            If the spectral radius is one or more, with what to do.
        """
        values = np.linalg.eigvals(self.A).astype(np.complex128)
        values = values[np.argsort(-np.abs(values), kind="stable")]
        values.flags.writeable = False
        if abs(values[0]) >= 1.0:
            warnings.warn(
                f"the spectral radius of the model is {abs(values[0]):.6f}: a free run grows by "
                f"{100 * (abs(values[0]) - 1):.2g} % a step in its worst mode and will diverge if "
                "it is long. Raise ridge, train on more data, use fewer state delays, or look for "
                "transients at the ends of the training runs.",
                SeakeepWarning,
                stacklevel=3,  # past the cached property
            )
        return values

    @property
    def spectral_radius(self) -> float:
        """Largest modulus of an eigenvalue of Â; a model is stable below one."""
        return float(np.abs(self.eigenvalues[0]))

    def modes(self) -> xr.Dataset:
        """Natural frequency and damping of each mode, slowest decay first.

        Returns
        -------
        Dataset
            Over ``mode`` (one of each conjugate pair): ``eigenvalue``, ``modulus``,
            ``frequency`` and ``natural_frequency`` (Hz), ``period`` (s), ``damping_ratio``,
            ``decay_time`` (s, to 1/e).
        """
        return forecasting.modes(self.eigenvalues, self.dt)

    def forecast(self, run: xr.Dataset, start: float, steps: int | None = None) -> xr.Dataset:
        """Free run driven by the measured input of `run`.

        States are read up to `start` and not after; inputs up to the instant before the last. The
        one exception is an alignment with ``surge="measured"``: it reads the surge after `start`
        too, and writes ``conditional_on`` into the result's attributes. Elevation that is carried
        upstream is read beyond these instants as well.

        Parameters
        ----------
        run : Dataset
            Channels of the model over ``time``; the order does not matter, further ones neither.
        start : float
            Instant of the last measured state, s; the nearest sample is taken. The
            ``history_samples`` samples up to it are needed.
        steps : int, optional
            Number of instants forecast; by default to the end of the run.

        Returns
        -------
        Dataset
            States at the `steps` instants after `start`, with units; ``attrs["start"]`` is the
            instant taken, ``attrs["status"]`` "ok" or from when on the forecast diverged (NaN
            from there).

        Raises
        ------
        RequestError
            If a channel is missing, or `start` and `steps` do not fit the run.
        DataError
            If the step or the units are not the model's, or needed samples are missing.
        """
        window = forecasting.read_window(self, run, start, steps)
        if self.alignment is None:
            return forecasting.label_forecast(self, window, self._free_run(window))
        if self.alignment.settings.surge == "predicted":
            values = aligned.closed_loop(self, aligned.prepare_loop(self, run, window))
        else:
            values = self._free_run(aligned.align_window(self, run, window))
        forecast = forecasting.label_forecast(self, window, values)
        return forecast.assign_attrs(aligned.notes(self.alignment, run))

    def forecast_windows(self, run: xr.Dataset, starts: Sequence[float], steps: int) -> xr.Dataset:
        """Free runs from several starts, side by side: much faster than one after the other.

        Parameters
        ----------
        run, steps
            As in :meth:`forecast`; `steps` holds for all.
        starts : sequence of float
            Instants of the last measured state, s.

        Returns
        -------
        Dataset
            States with dimensions (window, lead), ``lead`` in s after each ``start`` (over
            ``window``), and ``status`` over ``window``.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`, or if there is no start.
        """
        return forecast_windows(self, run, starts, steps)

    def _free_run(self, window: forecasting.ForecastWindow) -> FloatArray:
        return self.forecast_arrays(
            window.state_history, window.input_history, window.input_future, window.steps
        )

    def aligned_inputs(self, run: xr.Dataset) -> xr.Dataset:
        """Inputs of a run as the model wants them: carried to the measured position.

        What :meth:`forecast_arrays` and the exported systems take. Without an alignment, the
        inputs as they are.

        Parameters
        ----------
        run : Dataset
            Inputs, and surge if the alignment reads it, without gaps.

        Returns
        -------
        Dataset
            The inputs over ``time``.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        return aligned.aligned_inputs(self, run)

    def forecast_arrays(
        self,
        x_history: npt.ArrayLike,
        u_history: npt.ArrayLike,
        u_future: npt.ArrayLike,
        steps: int,
    ) -> FloatArray:
        """Free run from arrays, for use in a loop or on board.

        Parameters
        ----------
        x_history : array_like, shape (at least s + 1, N)
            States up to and including instant k, oldest first, physical units, in the order of
            ``model.states``; columns with names (a DataFrame) are taken by name.
        u_history : array_like, shape (at least z + 1, Q)
            Inputs up to and including instant k, in the order of ``model.inputs``, aligned already
            if the model aligns them (:meth:`aligned_inputs`).
        u_future : array_like, shape (at least steps − 1, Q)
            Inputs at k + 1, k + 2, …; shape (0, 0) for a model without input.
        steps : int
            Number of instants.

        Returns
        -------
        ndarray, shape (steps, N)
            States at k + 1 … k + steps, physical units; NaN from where the run diverged on.

        Raises
        ------
        RequestError
            If a shape does not fit (a transposed array is refused, not turned), a column is
            missing, or a value that is needed is not finite or masked.
        """
        x, u = forecasting.check_arrays(self, x_history, u_history, u_future, steps)
        values: FloatArray = free_runs(self, x[None], u[None], int(steps))[0]
        return values

    def to_state_space(self) -> signal.StateSpace:
        """Discrete state-space system in physical deviations from the means.

        The delay line of the inputs is part of the state, D = 0, ``dt`` is set. Its input is
        u − ``input_mean`` and its output x − ``state_mean``; u is aligned already
        (:meth:`aligned_inputs`) if the model has an alignment.

        Returns
        -------
        scipy.signal.StateSpace
            N(s+1) + Qz states, Q inputs, N outputs.

        Raises
        ------
        RequestError
            If the model has no input: scipy cannot represent it.
        """
        from scipy import signal

        return signal.StateSpace(*export.matrices(self), dt=self.dt)

    def to_control(self) -> control.StateSpace:
        """The system of :meth:`to_state_space` for python-control, with names.

        Returns
        -------
        control.StateSpace
            Needs the extra ``control``.
        """
        return export.to_control(self)

    def to_mat(self, path: str | Path) -> Path:
        """Write A, B, C, D, Ts, offsets, names (of the state's entries too) and units for MATLAB.

        Parameters
        ----------
        path : str or Path
            File to write; its suffix should be ``.mat``.

        Returns
        -------
        Path
            The file. In MATLAB: ``m = load('rom.mat'); sys = idss(m.A, m.B, m.C, m.D, 'Ts',
            m.Ts, 'InputName', m.InputName, 'OutputName', m.OutputName);``
        """
        return export.to_mat(self, path)

    def initial_state(self, run: xr.Dataset, start: float) -> FloatArray:
        """State of the exported system that continues a measured run.

        Parameters
        ----------
        run : Dataset
            As for :meth:`forecast`.
        start : float
            Instant of the last measured state, s.

        Returns
        -------
        ndarray, shape (N(s+1) + Qz,)
            State at `start`; the first output is the measured state there. Inputs in it are
            aligned with the measured surge up to `start`.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        window = forecasting.read_window(self, run, start, 1)
        history = window.input_history
        if self.alignment is not None:
            history = aligned.align_history(self, run, window)
        return export.initial_state(self, window.state_history, history)

    def initial_state_arrays(
        self, x_history: npt.ArrayLike, u_history: npt.ArrayLike
    ) -> FloatArray:
        """State of the exported system from arrays, for use in a loop or on board.

        Parameters
        ----------
        x_history, u_history : array_like, shapes (at least s + 1, N) and (at least z + 1, Q)
            As for :meth:`forecast_arrays`.

        Returns
        -------
        ndarray, shape (N(s+1) + Qz,)
            :math:`[x_k; x_{k-1}; …; x_{k-s}; u_{k-1}; …; u_{k-z}]`, less their means.

        Raises
        ------
        RequestError
            As :meth:`forecast_arrays`.
        """
        x, u = forecasting.check_arrays(self, x_history, u_history, [], 1)
        return export.initial_state(self, x, u)

    def summary(self) -> str:
        """Text that says what the model is and how it was identified.

        Returns
        -------
        str
            A few lines; reading it computes the eigenvalues.
        """
        return forecasting.summary(self)

    def save(self, path: str | Path) -> Path:
        """Write the model as NetCDF, to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File, overwritten if it exists.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_model` reads it, running no code from it.
        """
        return store.write(self.to_dataset(), path, store.HANKEL_DMDC)

    def to_dataset(self) -> xr.Dataset:
        """The model as a Dataset: what :meth:`save` writes."""
        return store.pack(
            settings=self.settings,
            training=self.training,
            labels={"state": self.state_labels, "input": self.input_labels},
            scales={"state": self.state_scale, "input": self.input_scale},
            dt=self.dt,
            coefficients=self.coefficients,
            alignment=self.alignment,
        )

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Rebuild a model from :meth:`to_dataset`.

        Parameters
        ----------
        dataset : Dataset
            What :meth:`save` wrote.

        Returns
        -------
        HankelDMDcModel
            Equal to the last bit.
        """
        parts = store.unpack(dataset)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SeakeepWarning)  # given when the model was made
            settings = HankelSettings(**parts.settings)
        states, inputs = (len(parts.labels[group]) for group in ("state", "input"))
        extended = states * (settings.state_delays + 1)
        rows = extended if settings.delay_rows == "ridge" else states
        shape = (rows, extended + inputs * (settings.input_delays + 1))
        if parts.coefficients.shape != shape:
            raise ValueError(f"coefficients have shape {parts.coefficients.shape}, not {shape}")
        return cls(
            settings=settings,
            coefficients=parts.coefficients,
            dt=parts.dt,
            state_labels=parts.labels["state"],
            input_labels=parts.labels["input"],
            state_scale=parts.scales["state"],
            input_scale=parts.scales["input"],
            training=Training(**parts.training),
            alignment=None
            if parts.alignment is None
            else FittedAlignment.from_dict(parts.alignment),
        )


def _read_only(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array
