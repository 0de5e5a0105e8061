r"""An identified model: forecast, stability, export, and its file.

Coefficients may vary with an attribute of the run, such as a draught.
Means and coefficients are linear in the parameter p, with q = (p − mean)/SD over the snapshots of
the training, :math:`\hat x_{j+1} = (K_0 + q K_1) [\hat x_j; \hat u_j]`. Both matrices are one ridge
regression on the regressors and q times the regressors; its Gram matrix is a sum over the runs of
:math:`[1, q; q, q^2] \otimes C_r`. At a value of the parameter the model is an ordinary one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import ComplexArray, Datasets, FloatArray, as_real, ratio, undefined
from seakeep.core.embedding import spread_means
from seakeep.core.solve import Solution, ridge_path
from seakeep.errors import DataError, RequestError, warn
from seakeep.models import engine, export, labelled, store
from seakeep.models.engine import Dynamics, Windows, linear_runs, parameter_of
from seakeep.models.forecasts import check_arrays, counted, rows_by_name, weighed_runs
from seakeep.models.growth import LeadErrors, linear_errors, stretches_of
from seakeep.models.inputs import Scale, Signature
from seakeep.models.labelled import Span
from seakeep.models.live import Servable
from seakeep.models.readouts import FittedReadOut
from seakeep.models.settings import HankelSettings
from seakeep.models.training import Training, TrainingData, system_of
from seakeep.models.validity import Coverage

if TYPE_CHECKING:
    import control
    from scipy import signal


@dataclass(frozen=True, eq=False)
class Variation:
    """How a model varies with its parameter.

    Parameters
    ----------
    slopes : ndarray, shape of the coefficients
        Their change per unit of q.
    shifts : tuple of ndarray
        Changes per unit of q of the means of states, delayed and direct regressors, physical units.
    centre, spread : float
        q is (p − centre)/spread.
    low, high : float
        Range of the parameter in training.
    """

    slopes: FloatArray
    shifts: tuple[FloatArray, ...]
    centre: float
    spread: float
    low: float
    high: float

    def at(
        self, coefficients: FloatArray, signature: Signature, value: float
    ) -> tuple[FloatArray, Signature]:
        """Coefficients and signature of the ordinary model at a value of the parameter."""
        if not self.low <= value <= self.high:
            warn(
                f"{signature.parameter} = {value:g} lies outside the {self.low:g} to "
                f"{self.high:g} of the training: the model extrapolates. Train on a run beyond it."
            )
        q = (value - self.centre) / self.spread
        moved = (
            replace(scale, mean=scale.mean + q * shift)
            for scale, shift in zip(signature.scales, self.shifts, strict=True)
        )
        return coefficients + q * self.slopes, replace(signature.scaled(*moved), parameter="")


@dataclass(frozen=True, eq=False)
class HankelDMDcModel(Servable):
    """An identified model; made by :meth:`HankelDMDc.fit` or :func:`seakeep.load_model`.

    Parameters
    ----------
    settings : Spec
        The settings it was identified with: those of a Hankel model or of a linear baseline.
    training : Training
        Runs, windows and form of the regression.
    signature : Signature
        Time step, names and units, delays, moments, and how inputs drive the model.
    coverage : Coverage
        Waves that it was trained in.
    coefficients : ndarray, shape (N(s+1) or N, N(s+1) + n(z+1) + m)
        Regressed rows of [Â B̂], on standardised deviations.
    learnt : LeadErrors, (TrainingData, runs) or HankelDMDcModel, optional
        Its errors in training, what it was fitted to, or the varying model that it was taken from,
        whose errors are its own. A member of an ensemble has none of them.
    selection : str
        How free runs chose what the settings left open; empty where they stated all.
    variation : Variation, optional
        How it varies with the parameter of its settings.
    """

    settings: Any
    training: Training
    signature: Signature = field(repr=False)
    coverage: Coverage = field(repr=False)
    coefficients: FloatArray = field(repr=False)
    # Hints are read by the store, which cannot look into the name of a mapping of runs.
    learnt: LeadErrors | tuple[TrainingData, Mapping[str, xr.Dataset]] | HankelDMDcModel | None = (
        field(default=None, repr=False)
    )
    selection: str = ""
    variation: Variation | None = field(default=None, repr=False)

    @classmethod
    def fitted(
        cls,
        settings: Any,
        data: TrainingData,
        solution: Solution,
        runs: Datasets,
        readouts: tuple[FittedReadOut, ...] = (),
    ) -> Self:
        """The model that a regression on data of these runs found."""
        signature = data.signature
        return cls(
            settings=settings,
            coefficients=solution.coefficients,
            signature=replace(signature, readouts=readouts),
            training=data.training(solution),
            coverage=Coverage.of(signature.inputs, data.inputs, signature.dt),
            learnt=(data, runs),
        )

    def __post_init__(self) -> None:
        self.coefficients.flags.writeable = False

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(states={self.states}, inputs={self.inputs}, "
            f"state_delays={self.state_delays}, input_delays={self.input_delays}, "
            f"dt={self.dt:g}; print(model.summary()) says more)"
        )

    @cached_property
    def errors(self) -> LeadErrors | None:
        """Its errors in training, computed on first use, which weigh forecasts and their bands.

        Those of a model that varies with a parameter are of the runs at each value together.
        """
        if isinstance(self.learnt, HankelDMDcModel):
            return self.learnt.errors
        if not isinstance(self.learnt, tuple):
            return self.learnt
        data, runs = self.learnt
        if self.variation is None:
            return self._errors_in(data, runs)
        values = [parameter_of(runs[name], self.signature.parameter, name) for name in data.names]
        by_run = [each.name for each in fields(data) if each.name != "signature"]
        known = []
        for value in sorted(set(values)):
            here = [each == value for each in values]
            own: Any = {each: tuple(compress(getattr(data, each), here)) for each in by_run}
            errors = self.at(parameter=value)._errors_in(replace(data, **own), runs)
            known += [] if errors is None else [errors]
        return LeadErrors.together(known) if known else None

    def _errors_in(self, data: TrainingData, runs: Datasets) -> LeadErrors | None:
        stretches = stretches_of(data, self.signature, runs)
        return linear_errors([self.dynamics], stretches, self.signature.readouts)

    @property
    def state_scale(self) -> Scale:
        """Moments of the states over the training windows."""
        return self.signature.state_scale

    @property
    def input_scale(self) -> Scale:
        """Moments of the inputs over the training windows."""
        return self.signature.input_scale

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

    @cached_property
    def A(self) -> FloatArray:
        """Â, shape (N(s+1), N(s+1)), on standardised deviations, newest block first."""
        return _read_only(self.dynamics.system)

    @cached_property
    def B(self) -> FloatArray:
        """B̂, shape (N(s+1), Q(z+1)), on standardised deviations, newest block first."""
        b = self.dynamics.matrices[1]
        missing = self.A.shape[0] - b.shape[0]
        return _read_only(np.concatenate([b, np.zeros((missing, b.shape[1]))]))

    @cached_property
    def eigenvalues(self) -> ComplexArray:
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
            warn(
                f"the spectral radius of the model is {abs(values[0]):.6f}: a free run grows by "
                f"{100 * (abs(values[0]) - 1):.2g} % per step in its worst mode and will diverge "
                "if it is long. Raise ridge, train on more data, use fewer state delays, look for "
                "transients at the ends of the training runs, or set stable = True."
            )
        return values

    @property
    def over_range(self) -> list[HankelDMDcModel]:
        """The model; of one that varies, those at both ends of its range and in the middle."""
        if (varies := self.variation) is None:
            return [self]
        return [self.at(parameter=each) for each in (varies.low, varies.high, varies.centre)]

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
        return modes(self.eigenvalues, self.dt)

    def free_runs(
        self, groups: Sequence[Windows], members: Sequence[int] = (0,)
    ) -> list[FloatArray]:
        """Free runs over groups of windows, each (1, window, steps, N), NaN from where lost."""
        if self.variation is None or not all(each.parameters for each in groups):
            run = partial(linear_runs, [self.dynamics], readouts=self.signature.readouts)
            return weighed_runs(self, run, groups)
        N = len(self.states)
        runs = [np.empty((1, len(each.parameters), each.steps, N)) for each in groups]
        for value in sorted({value for each in groups for value in each.parameters}):
            there = [np.array(each.parameters) == value for each in groups]
            computed = self.at(parameter=value).free_runs(groups)
            for values, own, here in zip(runs, computed, there, strict=True):
                values[:, here] = own[:, here]
        return runs

    def at(self, *, parameter: float) -> Self:
        """The ordinary model at a value of its parameter, for :meth:`live`, exports and arrays.

        Parameters
        ----------
        parameter : float
            Value of the attribute that ``settings.parameter`` names.

        Returns
        -------
        HankelDMDcModel

        Raises
        ------
        RequestError
            If the model does not vary with a parameter.

        Warns
        -----
        SeakeepWarning
            If the value lies outside those of the training.
        """
        if self.variation is None:
            raise RequestError(
                "the model does not vary with a parameter. Use it as it is, or fit one with "
                "parameter = '…', an attribute of the runs."
            )
        coefficients, signature = self.variation.at(self.coefficients, self.signature, parameter)
        return replace(
            self,
            settings=replace(self.settings, parameter=""),
            coefficients=coefficients,
            signature=signature,
            learnt=self,
            variation=None,
        )

    def system_matrices(self) -> Iterator[FloatArray]:
        """Â of each member, in the middle of the training where it varies with a parameter."""
        varies = self.variation
        yield self.A if varies is None else self.at(parameter=varies.centre).A

    @cached_property
    def dynamics(self) -> Dynamics:
        """What a free run needs."""
        if self.variation is not None:
            raise RequestError(
                f"the model varies with {self.signature.parameter}, whose value is not known here. "
                "Take the model at a value: model.at(parameter=…)."
            )
        return Dynamics(self.coefficients, self.signature)

    def aligned_inputs(self, run: xr.Dataset) -> xr.Dataset:
        """Inputs of a run as the model wants them: carried to the measured position.

        What :meth:`forecast_arrays` and the exported systems take. Without an alignment, and for
        a model that follows its own surge, the inputs as they are.

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
        name = labelled.run_name(run, "the run")
        labelled.check_run(run, name)
        values = labelled.channel_matrix(run, self.inputs, name)
        alignment = self.alignment
        if alignment is not None and self.signature.input_map.follows is None:
            labelled.check_finite(values, self.inputs, run, name)
            span = Span(0, len(values) - 1, len(values))
            values = alignment.carry(run, [span])
        variables = {
            channel: ("time", values[:, column], run[channel].attrs)
            for column, channel in enumerate(self.inputs)
        }
        return xr.Dataset(variables, coords={"time": run["time"]}, attrs=run.attrs)

    def forecast_arrays(
        self,
        x_history: npt.ArrayLike,
        u_history: npt.ArrayLike,
        u_future: npt.ArrayLike,
        steps: int,
        *,
        ahead: str = "refuse",
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
        u_future : array_like, shape (at least steps − 1 + lead_samples, Q)
            Inputs at k + 1, k + 2, …; shape (0, 0) for a model without input.
        steps : int
            Number of instants.
        ahead : {"refuse", "predict"}, optional
            What to do if `u_future` ends before the look-ahead: refuse, or predict it as
            :meth:`forecast` does, from all rows of `u_history` and `u_future`; tens of wave periods
            of history are best. Probes stand where they stood in training if the model carries
            them itself; other inputs are continued each from its own record.

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
        windows = check_arrays(self.signature, x_history, u_history, u_future, steps, ahead)
        return self.free_runs([windows])[0][0, 0]

    def jacobian(
        self, x_history: npt.ArrayLike, u_history: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the next states with respect to all that they depend on.

        Parameters
        ----------
        x_history : array_like, shape (at least ``signature.state_samples``, N)
            States up to and including instant k, as in :meth:`forecast_arrays`.
        u_history : array_like, shape (rows, Q)
            Inputs up to and including instant k + ``lead_samples``; rows as
            :func:`seakeep.hosts.start_rows` cuts them, and one more.

        Returns
        -------
        on_states : ndarray, shape (N, signature.state_samples, N)
            ∂x(k+1)/∂x, the last axes being those of the rows at the end of `x_history`.
        on_inputs : ndarray, shape (N, rows, Q)
            ∂x(k+1)/∂u in the same way.

        Notes
        -----
        Central differences over 10⁻³ training SDs: exact but for rounding where the step is linear
        or quadratic in its rows. A model that follows its surge takes a run for each number.
        """
        signature = self.signature
        rows = signature.input_history + 1 + signature.lead_samples
        x = rows_by_name(
            "x_history", x_history, signature.state_samples, self.states, "of the states"
        )[-signature.state_samples :]
        u = rows_by_name("u_history", u_history, rows, self.inputs, "of the inputs")[-rows:]
        spreads = signature.state_scale.spread, signature.input_scale.spread[: len(self.inputs)]
        parts = []
        for values, spread in zip((x, u), spreads, strict=True):
            steps = 1e-3 * np.tile(spread, len(values))
            near = np.concatenate([np.diag(steps), -np.diag(steps)]).reshape(-1, *values.shape)
            both = [np.broadcast_to(each, (len(near), *each.shape)) for each in (x, u)]
            both[values is u] = values + near
            windows = engine.array_windows(signature, both[0], both[1], 1)
            high, low = np.split(self.free_runs([windows])[0][0, :, 0], 2)
            parts.append(((high - low) / (2 * steps[:, None])).T.reshape(-1, *values.shape))
        return parts[0], parts[1]

    @property
    def _serving(self) -> tuple[Self, list[Dynamics], LeadErrors | None]:
        """What forecasts in service, what its filter predicts with, and errors in training."""
        return self, [self.dynamics], self.errors

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

        return signal.StateSpace(*self._system(), dt=self.dt)

    def to_control(self) -> control.StateSpace:
        """The system of :meth:`to_state_space` for python-control, with names.

        Returns
        -------
        control.StateSpace
            Needs the extra ``control``.
        """
        return export.to_control(self._system(), self.signature)

    def to_mat(self, path: str | Path, order: int | None = None) -> Path:
        """Write A, B, C, D, Ts, offsets, names (of the state's entries too) and units for MATLAB.

        With observables the inputs of the system are the regressors; the file holds filters, as
        state-space systems too, and a function that make them of measured inputs. Its entry
        ``Regressors`` says how.

        Parameters
        ----------
        path : str or Path
            File to write; its suffix should be ``.mat``. It replaces no file but another system.
        order : int, optional
            Order to which balanced truncation brings the system. Its entry ``ErrorPeak`` is the
            largest gain of the error, SDs of outputs per SD of inputs, at 400 frequencies,
            ``ErrorBound`` the largest that it can have at any; its state is no longer that of
            :meth:`initial_state`, and starts from zero.

        Returns
        -------
        Path
            The file. In MATLAB: ``m = load('rom.mat'); sys = idss(m.A, m.B, m.C, m.D, 'Ts',
            m.Ts, 'InputName', m.InputName, 'OutputName', m.OutputName);``
        """
        return export.to_mat(self._system(is_file=True), self.signature, path, order)

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
        windows = self.read_windows(run, [start], 1)
        return export.initial_state(self.signature, windows)

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
        lead: npt.ArrayLike = []
        if self.inputs:  # what comes later is not part of the state
            given = as_real(u_history, "u_history")
            lead = given[-1:].repeat(self.lead_samples, axis=0) if given.ndim else given
        windows = check_arrays(self.signature, x_history, u_history, lead, 1)
        return export.initial_state(self.signature, windows)

    def _system(self, *, is_file: bool = False) -> export.System:
        export.check_linear(self.signature)
        if not all(each.terms for each in self.signature.input_map.observed.bound):
            is_file = False  # only Python computes them
        if not is_file and (more := self.regressors[len(self.inputs) :]):
            raise RequestError(
                f"the model is driven by observables too ({', '.join(more)}), which a state-space "
                "system in its inputs cannot represent. Use forecast_arrays, export C, an FMU, an "
                "ONNX graph or a MATLAB file, or fit a model with observables=[]."
            )
        if read := [each.channel for each in self.signature.readouts if each.acts]:
            raise RequestError(
                f"the model reads {', '.join(read)} off its other states, or rests it on a floor, "
                "which no linear system can represent. Export C, an FMU or an ONNX graph, use "
                "forecast_arrays, or fit the model with readouts = {} in [model]."
            )
        return export.matrices(self.A, self.B, self.signature)

    def summary(self) -> str:
        """Text that describes the model and its identification.

        Returns
        -------
        str
            A few lines; reading it computes the eigenvalues.
        """
        chosen = []
        if self.selection:
            chosen.append("  chosen        " + self.selection.replace("\n", "\n  "))
        if self.settings.title:
            return "\n".join([f"{self.settings.title}, dt {self.dt:g} s", *self.lines(), *chosen])
        rows = "exact" if self.settings.delay_rows == "exact" else "regressed"
        memory = ""
        if blocks := self.settings.blocks:
            memory = (
                f"; {counted(len(blocks), 'mean')} over delays of {blocks[0][0] + 1} samples and "
                "more"
            )
        lines = [
            f"Hankel DMD with control: {counted(len(self.states), 'state')}, "
            f"{counted(len(self.inputs), 'input')}, dt {self.dt:g} s",
            *self.lines(f"{_regression(self.settings, self.training)}; delay rows {rows}{memory}"),
            *chosen,
        ]
        shown, where = self, ""
        if (varies := self.variation) is not None:
            lines.append(
                f"  parameter     {self.signature.parameter}, trained from {varies.low:g} to "
                f"{varies.high:g}; modes in the middle, {varies.centre:g}"
            )
            shown, where = self.at(parameter=varies.centre), ", the largest at ends and middle"
        radius = max(spectral_radius(each.dynamics) for each in self.over_range)
        verdict = "stable" if radius < 1 else "UNSTABLE: long forecasts diverge"
        lines.append(f"  stability     spectral radius {radius:.6f}{where} ({verdict})")
        if clipped := self.training.clipped:
            lines.append(
                f"    {counted(len(clipped), 'eigenvalue')} clipped to {self.settings.radius:g}; "
                f"the largest was {clipped[0]:.6f}"
            )
        table = shown.modes()
        for mode in range(min(5, table.sizes["mode"])):
            at = table.isel(mode=mode)
            lines.append(
                f"    mode {mode + 1}: {float(at.natural_frequency):.4g} Hz, damping ratio "
                f"{float(at.damping_ratio):.3g}, |eigenvalue| {float(at.modulus):.6f}"
            )
        return "\n".join(lines)

    def to_dataset(self) -> xr.Dataset:
        """The model as a Dataset: what :meth:`save` writes."""
        return store.packed(replace(self, learnt=self.errors))


def spectral_radius(dynamics: Dynamics) -> float:
    """Largest modulus of an eigenvalue of Â."""
    return float(np.abs(np.linalg.eigvals(dynamics.system)).max())


def modes(eigenvalues: ComplexArray, dt: float) -> xr.Dataset:
    """Modes of a discrete system from its eigenvalues; see ``HankelDMDcModel.modes``."""
    upper = eigenvalues[eigenvalues.imag >= 0]
    with undefined():
        poles = np.log(upper) / dt
        natural = np.abs(poles)
        frequency = np.abs(poles.imag) / (2 * np.pi)
        # An eigenvalue of zero is gone after a step: overdamped, not undefined.
        oscillating = (natural > 0) & np.isfinite(natural)
        damping = np.where(oscillating, -poles.real / natural, 1.0)
        decay = ratio(1.0, -poles.real, np.inf)
        period = ratio(1.0, frequency, np.inf)
    table = {
        "eigenvalue": (upper, "1", "eigenvalue of the discrete system"),
        "modulus": (np.abs(upper), "1", "modulus of the eigenvalue"),
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


def _regression(settings: HankelSettings, training: Training) -> str:
    if settings.rank is not None:
        return f"truncated SVD of rank {training.rank}"
    form = {"primal": "primal form", "dual": "dual form", "svd": "singular values"}
    per = ""
    if settings.ridge_scale == "per_snapshot":
        per = f" ({settings.ridge:g} per snapshot pair)"
    return f"ridge {training.ridge:g}{per}, {form[training.method]}"


def _read_only(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array


def regress_varying(
    data: TrainingData, settings: HankelSettings, parameter: str, values: Sequence[float]
) -> tuple[Solution, TrainingData, Variation]:
    """Regress on the regressors and on q times them.

    Parameters
    ----------
    data : TrainingData
        Gathered runs.
    settings : HankelSettings
        Exact delay rows.
    parameter : str
        Name of the parameter.
    values : sequence of float
        Parameter of each run.

    Returns
    -------
    solution : Solution
        With the coefficients at q = 0.
    data : TrainingData
        With the means at q = 0.
    variation : Variation
        What varies.

    Raises
    ------
    DataError
        If all runs have the same value.
    """
    known, counts = np.array(values), np.array([each.columns for each in data.windows])
    if np.ptp(known) == 0:
        raise DataError(
            f"all runs have {parameter} = {known[0]:g}, so that nothing can be "
            "learnt of it. Train on runs at two values or more, or leave parameter out."
        )
    centre = float(np.average(known, weights=counts))
    spread = float(np.sqrt(np.average((known - centre) ** 2, weights=counts)))
    q = (known - centre) / spread
    series, shifts, scales = [], [], []
    for scale, each in zip(data.signature.scales, data.series, strict=True):
        means = np.stack(
            [
                x[window.first_column : window.last + 1].mean(axis=0)
                for x, window in zip(each, data.windows, strict=True)
            ]
        )
        at_zero, slope = np.average(means, axis=0, weights=counts), (q * counts) @ means
        slope = slope / counts.sum()  # q has mean 0 and mean square 1
        if not settings.standardize:
            at_zero, slope = np.zeros_like(at_zero), np.zeros_like(slope)
        series.append([x - at_zero - part * slope for x, part in zip(each, q, strict=True)])
        shifts.append(slope * scale.std)
        scales.append(replace(scale, mean=scale.mean + at_zero * scale.std))
    gram: Any = 0.0
    right: Any = 0.0
    for run, (window, part) in enumerate(zip(data.windows, q, strict=True)):
        system, both = system_of([[x[run]] for x in series], [window], settings), [1.0, part]
        gram += np.kron(np.outer(both, both), system.whole)
        right += np.kron(both, system.right)
    factor = counts.sum() if settings.ridge_scale == "per_snapshot" else 1.0
    ridge = factor * float(settings.ridge)
    parts = np.split(ridge_path(gram, right, [ridge])[0], 2, axis=1)
    size = len(data.signature.states)
    fixed, slopes = (
        spread_means(each, size, settings.state_delays, settings.blocks) for each in parts
    )
    low, high = float(known.min()), float(known.max())
    variation = Variation(slopes, tuple(shifts), centre, spread, low, high)
    signature = replace(data.signature.scaled(*scales), parameter=parameter)
    data = replace(data, signature=signature)
    return Solution(fixed, "primal", ridge, len(gram)), data, variation
