"""Models to compare with: constant forecasts, and classic linear identification.

They fit, forecast, save and load as :class:`seakeep.HankelDMDc` does, take the same runs, and go
through studies and reports by their ``kind``. :mod:`seakeep.baselines` is the public name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from seakeep.arrays import FloatArray, whole_number
from seakeep.core.embedding import History
from seakeep.core.solve import Solution
from seakeep.core.subspace import StateSpace, identify_subspace
from seakeep.errors import RequestError
from seakeep.models.engine import Windows, open_runs
from seakeep.models.forecasts import Model, counted, weighed_runs
from seakeep.models.growth import LeadErrors, lead_errors, stretches_of
from seakeep.models.inputs import Signature
from seakeep.models.labelled import Runs, Stop, TrainingRuns
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.readouts import ReadOuts
from seakeep.models.selection import RIDGES, select
from seakeep.models.settings import (
    DelayRows,
    HankelSettings,
    RidgeScale,
    Role,
    periods_to_samples,
)
from seakeep.models.training import Training, TrainingData, gather
from seakeep.models.validity import Coverage

WINDOWS = (5.0, 15.0)
"""Encounter periods over which filters are judged, as far as they fit into what is held out."""
LARGER = (0.316, 1.0)
"""λ per snapshot pair that are tried of filters beside those of other models: short windows ask for
more."""
ORDER = 40
"""Latent states of a subspace model, where the future has as many values."""


def _fixed(value: Any) -> Any:
    """A setting that a kind of model leaves no choice of."""
    return field(default=value, init=False, repr=False)


@dataclass(frozen=True)
class Plain(HankelSettings):
    """Settings with exact delay rows, of a model without truncation, read-outs and memory."""

    n_members: ClassVar[int] = 1
    delay_rows: DelayRows = _fixed("exact")
    rank: int | None = _fixed(None)
    readouts: ReadOuts = _fixed(())
    stable: bool | float = _fixed(False)
    memory: int = _fixed(0)


@dataclass(frozen=True)
class Constant(Plain):
    """A model of nothing but the last state: its deviation from the mean, times a factor.

    Parameters
    ----------
    window : int or str, optional
        Snapshots per run; None takes all up to ``stop``.
    """

    model: ClassVar[type] = HankelDMDcModel
    factor: ClassVar[float]
    role: ClassVar[Role] = "reference"
    state_delays: int = _fixed(0)
    input_delays: int = _fixed(0)
    ridge: float = _fixed(0.0)
    history: History = _fixed("inside")
    ridge_scale: RidgeScale = _fixed("absolute")
    standardize: bool = _fixed(True)
    alignment: None = _fixed(None)
    lead: int = _fixed(0)
    observables: tuple[()] = _fixed(())
    centre: int = _fixed(0)

    def fit(
        self, runs: Runs, states: Sequence[str], inputs: Sequence[str] = (), stop: Stop = None
    ) -> HankelDMDcModel:
        """Take the moments of the states; arguments and errors as :meth:`seakeep.HankelDMDc.fit`.

        `inputs` are accepted and not read.
        """
        given = TrainingRuns.of(runs, states, [], stop)
        spec = self.resolved_in(given.runs, [])
        data = gather(given, spec)
        size = len(data.signature.states)
        solution = Solution(self.factor * np.eye(size), "svd", 0.0, size * bool(self.factor))
        return HankelDMDcModel.fitted(spec, data, solution, given.runs)


class Mean(Constant):
    """The mean of each state over the training windows, at all instants (climatology).

    No model of a stationary response should be worse over a long horizon; its NRMSE is one where
    the test has the mean and the spread of the training. Inputs are not read.

    Parameters
    ----------
    window : int or str, optional
        Snapshots per run; None takes all up to ``stop``.

    Examples
    --------
    >>> from seakeep.baselines import Mean
    >>> Mean().needs(0.05).history
    0
    """

    kind = "mean"
    title = "Mean of the training windows"
    factor = 0.0


class HoldLast(Constant):
    """The measured state at the start, at all instants (persistence).

    Hard to beat over a small part of a period. Inputs are not read.

    Parameters
    ----------
    window : int or str, optional
        Snapshots per run, from which the spread is taken; None takes all up to ``stop``.
    """

    kind = "hold_last"
    title = "Hold last: the state at the start, kept constant"
    factor = 1.0


@dataclass(frozen=True)
class LinearSpec(Plain):
    """A linear model of delayed states and inputs: it finds coefficients, the rest is common."""

    model: ClassVar[type] = HankelDMDcModel
    may_choose: ClassVar[bool] = True
    opened: ClassVar[tuple[str, ...]] = ()

    def fit(
        self, runs: Runs, states: Sequence[str], inputs: Sequence[str], stop: Stop = None
    ) -> HankelDMDcModel:
        """Fit the model; arguments and errors as :meth:`seakeep.HankelDMDc.fit`."""
        given = TrainingRuns.of(runs, states, inputs, stop)
        if self.is_filter and not given.inputs:
            raise RequestError(
                f"a {self.kind.upper()} model is a filter of its inputs and has none; name at "
                "least one input."
            )
        spec = self.resolved_in(given.runs, given.inputs)
        if self.ridge != "rollout":
            data = gather(given, spec)
            solution = spec.solve(data)
            count = len(given.states) * (spec.state_reach + 1) + data.direct[0].shape[1]
            needed = len(given.states), count + data.delayed[0].shape[1] * (spec.input_delays + 1)
            coefficients = solution.coefficients
            if coefficients.shape != needed or not np.isfinite(coefficients).all():
                lost = np.count_nonzero(~np.isfinite(coefficients))
                raise RequestError(
                    f"solve of '{self.kind}' returned coefficients of shape {coefficients.shape}, "
                    f"{lost} of them not finite; finite ones of shape {needed} are needed."
                )
            return HankelDMDcModel.fitted(spec, data, solution, given.runs)
        read = given
        if spec.window is not None:  # what the model reads, and no more
            input_map = spec.input_map(given, spec.window)
            before = spec.centre + input_map.history(spec.input_delays)
            first = -spec.window - max(spec.state_reach, before)
            last = {name: run.isel(time=slice(first, None)) for name, run in given.runs.items()}
            read = given._replace(runs=last)
        start = replace(spec, window=None, ridge=RIDGES[-1], ridge_scale="per_snapshot")
        chosen = select(
            start,
            *read,
            opened=self.opened,
            ridges=(*RIDGES, *LARGER),
            horizon=WINDOWS,
        )
        model = replace(chosen.settings, window=spec.window).fit(*given)
        return replace(model, selection=chosen.describe())

    def solve(self, data: TrainingData) -> Solution:
        """Coefficients on standardised deviations, shape (N, N(s+1) + n(z+1) + m).

        By default the rows of the next states that these settings regress.
        """
        return data.regress(self)


@dataclass(frozen=True)
class ARX(LinearSpec):
    r"""Autoregression with exogenous inputs: the classic least squares.

    :math:`x_{j+1} = \sum_{l=0}^s A_l x_{j-l} + \sum_{l=0}^z B_l u_{j-l}` (Ljung, System
    Identification, 1999, section 4.2), on standardised deviations. It is the Hankel model with
    exact delay rows and without ridge.

    Parameters
    ----------
    state_delays, input_delays : int
        s and z. A forecast needs max(s, z) + 1 samples of history.
    ridge : float or "rollout", optional
        λ added to the diagonal; zero is least squares, of least norm where it is not unique.
        "rollout" chooses it by forecasts of training runs, or of thirds of one, that are held out
        in turn.
    ridge_scale : {"absolute", "per_snapshot"}, optional
        Whether λ is multiplied by the number of columns.
    window, history, standardize, alignment, lead, observables
        As in :class:`seakeep.HankelDMDc`.
    """

    kind: ClassVar[str] = "arx"
    role: ClassVar[Role] = "reference"
    title: ClassVar[str] = "ARX: least squares on past states and inputs"
    ridge: float | Literal["rollout"] = 0.0

    @classmethod
    def recommended(cls, encounter_period: float, dt: float) -> Self:
        """One encounter period of the states, three of the inputs, and λ chosen on held-out data.

        Plain least squares diverges where a period is finely sampled.
        """
        s, z = (periods_to_samples(periods, encounter_period, dt) for periods in (1, 3))
        return cls(state_delays=s, input_delays=z, ridge="rollout", ridge_scale="per_snapshot")


@dataclass(frozen=True)
class FIR(LinearSpec):
    r"""Finite impulse response: the states are a filter of the inputs.

    :math:`x_{j+1} = \sum_{l=0}^z B_l u_{j-l}` on standardised deviations: what the waves decide
    alone, without memory of the states. The delays must cover the memory of the response.

    Parameters
    ----------
    input_delays : int
        z. A forecast needs z + 1 samples of history.
    ridge : float or "rollout", optional
        λ, for inputs of a narrow band, whose past and present are nearly the same. "rollout"
        chooses it, and z among 1, 0.6 and 0.4 times what is stated, by forecasts of training runs,
        or of thirds of one, that are held out in turn.
    ridge_scale : {"absolute", "per_snapshot"}, optional
        Whether λ is multiplied by the number of columns.
    window, history, standardize, alignment, lead, observables
        As in :class:`seakeep.HankelDMDc`.
    """

    kind: ClassVar[str] = "fir"
    role: ClassVar[Role] = "reference"
    title: ClassVar[str] = "FIR: a filter of the inputs, without states"
    is_filter: ClassVar[bool] = True
    opened: ClassVar[tuple[str, ...]] = ("input_delays",)
    state_delays: int = field(default=0, init=False, repr=False)
    ridge: float | Literal["rollout"] = 1e-3
    ridge_scale: RidgeScale = "per_snapshot"

    @classmethod
    def recommended(cls, encounter_period: float, dt: float) -> Self:
        """Up to three encounter periods of the inputs, and λ, chosen on held-out data."""
        return cls(input_delays=periods_to_samples(3, encounter_period, dt), ridge="rollout")

    def solve(self, data: TrainingData) -> Solution:
        """Filters of the inputs, beside zeros for the states."""
        system = super().solve(data)
        size = len(system.coefficients)
        return replace(
            system, coefficients=np.hstack([np.zeros((size, size)), system.coefficients])
        )


@dataclass(frozen=True, eq=False)
class SubspaceModel(Model):
    """Model fitted by :class:`Subspace`.

    Parameters
    ----------
    settings : Subspace
        The settings it was identified with.
    training : Training
        Runs and windows.
    signature : Signature
        Time step, names and units, delays, moments, and how inputs drive the model.
    coverage : Coverage
        Waves that it was trained in.
    space : StateSpace
        Matrices on standardised deviations, and the filter that finds the latent state.
    errors : LeadErrors, optional
        Its errors in training, which weigh forecasts from predicted waves.
    """

    settings: Subspace
    training: Training
    signature: Signature = field(repr=False)
    coverage: Coverage = field(repr=False)
    space: StateSpace = field(repr=False)
    errors: LeadErrors | None = field(default=None, repr=False)

    def free_runs(
        self, groups: Sequence[Windows], members: Sequence[int] = (0,)
    ) -> list[FloatArray]:
        """Free runs over groups of windows, each (1, window, steps, N), NaN from where lost."""
        return weighed_runs(self, self._runs, groups)

    def _runs(self, groups: Sequence[Windows]) -> list[FloatArray]:
        """The same, where no wave is predicted."""
        runs = open_runs(
            self.signature,
            groups,
            lambda batches: [self.space.free_runs(*each) for each in batches],
        )
        return [
            (values if windows.zero is None else values + windows.zero[:, None])[None]
            for values, windows in zip(runs, groups, strict=True)
        ]

    def system_matrices(self) -> Iterator[FloatArray]:
        """A."""
        yield self.space.A

    def summary(self) -> str:
        """Text that describes the model and its identification."""
        radius = float(np.abs(np.linalg.eigvals(self.space.A)).max())
        return "\n".join(
            [
                f"Subspace model (N4SID): {self.settings.order} latent states, dt {self.dt:g} s",
                *self.lines(),
                f"  stability     spectral radius {radius:.6f}",
            ]
        )


@dataclass(frozen=True)
class Subspace(Plain):
    r"""State-space model by subspace identification (N4SID).

    :math:`z_{j+1} = A z_j + B u_j`, :math:`x_{j+1} = C z_j + D u_j` with a latent state that is a
    filter of the past, :mod:`seakeep.core.subspace` (Van Overschee and De Moor, Automatica 30,
    1994).

    Parameters
    ----------
    state_delays, input_delays : int
        s and z, how far back the past reaches. A forecast needs max(s, z) + 1 samples of history.
    order : int, optional
        Number of latent states; by default 40, or as many as the future has values.
    future : int, optional
        Instants of the future that the state must predict; by default s + 1.
    ridge : float, optional
        λ per snapshot of the first regression, for inputs that predict their own future.
    window, history, standardize, alignment, lead, observables
        As in :class:`seakeep.HankelDMDc`; an alignment to the predicted surge is refused.
    """

    kind: ClassVar[str] = "subspace"
    model: ClassVar[type] = SubspaceModel
    role: ClassVar[Role] = "reference"
    has_path: ClassVar[bool] = False
    ridge: float = 1e-3
    ridge_scale: RidgeScale = _fixed("per_snapshot")
    order: int | None = field(default=None, kw_only=True)
    future: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in (("order", self.order), ("future", self.future)):
            if value is not None:
                whole_number(value, name)
        if self.follows_surge:
            raise RequestError(
                "a subspace model cannot be aligned to the surge that it predicts itself. Use "
                "alignment surge = 'measured' or 'none'."
            )

    @classmethod
    def recommended(cls, encounter_period: float, dt: float) -> Self:
        """One encounter period of the states, three of the inputs, λ = 0.1."""
        s, z = (periods_to_samples(periods, encounter_period, dt) for periods in (1, 3))
        return cls(state_delays=s, input_delays=z, ridge=0.1)

    def fit(
        self, runs: Runs, states: Sequence[str], inputs: Sequence[str], stop: Stop = None
    ) -> SubspaceModel:
        """Identify a model; arguments and errors as :meth:`seakeep.HankelDMDc.fit`."""
        given = TrainingRuns.of(runs, states, inputs, stop)
        spec = self.resolved_in(given.runs, given.inputs)
        data = gather(given, spec)
        future = spec.state_delays + 1 if spec.future is None else spec.future
        most = future * len(data.signature.states)
        order = min(ORDER, most) if spec.order is None else spec.order
        if order > most:
            raise RequestError(
                f"order = {order} is more than the {most} values of {future} future instants "
                f"of {counted(len(data.signature.states), 'state')}. In the table of the "
                "model, lower the key order, or raise the key future."
            )
        space = identify_subspace(
            data.states,
            data.delayed,
            data.direct,
            data.windows,
            order=order,
            output_delays=spec.state_delays,
            input_delays=spec.input_delays,
            future=future,
            ridge=float(spec.ridge),
        )
        columns = sum(window.columns for window in data.windows)
        solution = Solution(space.A, "svd", float(spec.ridge) * columns, order)
        signature = data.signature
        model = SubspaceModel(
            settings=replace(spec, order=order),
            space=space,
            signature=signature,
            training=data.training(solution),
            coverage=Coverage.of(signature.inputs, data.inputs, signature.dt),
        )
        errors = lead_errors(
            lambda windows, _: model._runs([windows])[0][0],
            (signature.state_delays, signature.input_delays),
            order + space.D.shape[1],
            stretches_of(data, signature, given.runs),
        )
        return replace(model, errors=errors)


RIVALS = FIR(0), ARX(0, 0), Subspace(0, 0, 0.1)
"""Kinds that a search may try beside a Hankel model, whose delays and inputs they take."""
