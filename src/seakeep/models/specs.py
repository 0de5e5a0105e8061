"""Settings of the Hankel model and of its ensemble, and how each is fitted."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Generic, Literal, Self, TypeVar, get_args

import numpy as np
import xarray as xr

from seakeep.arrays import (
    Datasets,
    Json,
    Progress,
    check_choice,
    check_flag,
    settings_of,
    whole_number,
)
from seakeep.errors import SHOWN, DataError, RequestError, quiet
from seakeep.models import labelled, store
from seakeep.models.alignment import ProbeAlignment
from seakeep.models.baselines import FIR, Subspace
from seakeep.models.candidates import MEMORY, default_observables
from seakeep.models.engine import parameter_of
from seakeep.models.ensemble import (
    PRIORS,
    Draw,
    HankelEnsemble,
    Sampling,
    TrainOn,
    draw_members,
    draws_of,
)
from seakeep.models.forecasts import Spec
from seakeep.models.inputs import Signature
from seakeep.models.labelled import Runs, Stop, TrainingRuns, as_runs
from seakeep.models.linear import HankelDMDcModel, regress_varying, spectral_radius
from seakeep.models.readouts import FittedReadOut
from seakeep.models.selection import (
    FreeRuns,
    Selected,
    readouts_for,
    scores_of,
    settle,
)
from seakeep.models.settings import (
    OPENED,
    HankelSettings,
    LogUniform,
    Needs,
    Prior,
    Select,
    Uniform,
    in_samples,
    periods_to_samples,
    prior_of,
)
from seakeep.models.training import RunArrays, departing, gather, moments
from seakeep.models.validity import Coverage
from seakeep.toml import Length

PAPER_RIDGE = 100.0
HORIZON = 15.0
"""Length of the free runs that compare models with a parameter and without, encounter periods."""
SMALLER = (1.0, 0.1, 1e-2, 1e-3)
"""Parts of the pooled model's λ that are tried: that is large where conditions disagree."""
BETTER = 0.95
"""Part of the pooled model's error below which the parameter is worth its coefficients."""
STATE_PERIODS, INPUT_PERIODS, LEAD_PERIODS = 1.0, 3.0, 0.75
"""Delays and look-ahead that we recommend; a search from there gains a twentieth at most."""
ALIGNMENT = ProbeAlignment(mode="dispersion", surge="predicted", optional=True)
"""Of what we recommend."""
STATED = "nothing: all is stated; seakeep tune finds the error without each observable"
"""How the settings of a model were chosen that leave nothing open, where it has observables."""


Fitted = TypeVar("Fitted", HankelDMDcModel, HankelEnsemble)


@dataclass(frozen=True)
class Choosing(HankelSettings, Generic[Fitted]):
    """Settings of which free runs choose what is left open."""

    may_choose: ClassVar[bool] = True
    select: Select | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        select = settings_of(Select, "select", self.select, "observables=True")
        object.__setattr__(self, "select", select)

    @property
    def is_open(self) -> bool:
        """Whether something is left to be chosen by free runs."""
        return isinstance(self.ridge, str) or self.select is not None

    def central(self, dt: float) -> HankelDMDc:
        """The single model at the middle of what is fitted."""
        raise NotImplementedError

    def _adopt(self, choice: Selected[HankelDMDc]) -> Selected[Self]:
        """These settings with what was chosen for :meth:`central`."""
        raise NotImplementedError

    def variants(self, given: TrainingRuns, *settings: Self) -> list[tuple[Self, str]]:
        """Settings to fit until a model does not grow, each with words on its choice."""
        return [(each, "") for each in settings]

    def _fitted(self, given: TrainingRuns, readouts: tuple[FittedReadOut, ...]) -> Fitted:
        """What settings that leave nothing to be chosen give of runs cut where training ends."""
        raise NotImplementedError

    def settled(
        self,
        runs: Runs,
        states: Sequence[str],
        inputs: Sequence[str],
        stop: Stop = None,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> Selected[Self]:
        """Choose by free runs what the settings leave to be chosen; nothing is fitted.

        Parameters
        ----------
        runs, states, inputs, stop
            As in :meth:`fit`.
        executor : concurrent.futures.Executor, optional
            Works on several candidates side by side; the result is the same.
        progress : callable, optional
            Called as ``progress(done, total, what)``.

        Returns
        -------
        Selected
            ``settings``, complete; ``rows``, what was tried; ``describe()``.

        Raises
        ------
        RequestError, DataError
            As :meth:`fit`.
        """
        given = TrainingRuns.of(runs, states, inputs, stop)
        spec = self.resolved_in(given.runs, given.inputs)
        choice = settle(
            spec.central(labelled.common_step(given.runs)),
            given,
            kinds=(FIR(0), Subspace(0, 0, 0.1)),
            executor=executor,
            progress=progress,
        )
        return spec._adopt(choice)

    def fit(
        self,
        runs: Runs,
        states: Sequence[str],
        inputs: Sequence[str],
        stop: Stop = None,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
        selected: Selected[HankelDMDc] | None = None,
    ) -> Fitted:
        """Identify a model; the settings are not changed by it.

        Parameters
        ----------
        runs : Dataset, sequence of Dataset, or mapping of names to Datasets
            Runs with the dimension ``time`` (s, uniform, the same step in all) and one variable
            per channel. Several are pooled.
        states : sequence of str
            Channels to forecast.
        inputs : sequence of str
            Channels that drive them; may be empty (autonomous Hankel DMD).
        stop : float, sequence or mapping of float, optional
            Last instant of the training window, s; one for all runs, or one per run. By default
            each run's end.
        executor, progress
            As in :meth:`settled`, where something is to be chosen.
        selected : Selected, optional
            What the settled :meth:`central` found in these runs, so that it is not looked for
            again.

        Returns
        -------
        HankelDMDcModel or HankelEnsemble
            The model, immutable; its ``settings`` are complete.

        Raises
        ------
        RequestError
            If a channel is unknown, or `stop` lies outside a run.
        DataError
            If a run is too short, has gaps or times that are not uniform, another step than the
            first, or a constant channel while ``standardize`` is set; if the model that was chosen
            grows.
        """
        given = TrainingRuns.of(runs, states, inputs, stop)
        spec = self.resolved_in(given.runs, given.inputs)
        if not self.is_open:
            readouts: tuple[FittedReadOut, ...] = ()
            if self.readouts:
                central = spec.central(labelled.common_step(given.runs))
                readouts = readouts_for(central, given)
            model = spec._fitted(given, readouts)
            return replace(model, selection=STATED if self.observables else "")
        if selected is not None:
            choice = spec._adopt(selected)
        else:
            choice = spec.settled(*given, executor=executor, progress=progress)
        for settings, words in self.variants(given, choice.settings):
            model = settings._fitted(given, choice.readouts)
            radius = largest_radius(model) if isinstance(model, HankelDMDcModel) else 0.0
            if radius < 1.0:
                return replace(model, selection=words + choice.describe())
        raise DataError(
            f"the model that was chosen grows: its spectral radius is {radius:.6f} at "
            f"{settings.ridge_text(float(settings.ridge))}. Train on more, look for transients at "
            "the ends of the training runs, use fewer state delays, clip eigenvalues (stable=True, "
            "or stable = true in the table of the model), or state the ridge to have it as it is."
        )


@dataclass(frozen=True)
class HankelDMDc(Choosing[HankelDMDcModel]):
    r"""Settings of a Hankel dynamic mode decomposition with control.

    The model is :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j` with
    :math:`\hat x_j = [x_j; …; x_{j-s}]`, :math:`\hat u_j = [u_j; …; u_{j-z}]`, and
    :math:`[\hat A\; \hat B] = \hat X' \hat Y^T (\hat Y \hat Y^T + \lambda I)^{-1}` on
    standardised deviations (paper, section HDMDc).

    Parameters
    ----------
    state_delays : int or str
        s, number of delayed copies of the states: samples, or a length such as ``"1 T"``
        (encounter periods) or ``"0.5 s"``.
    input_delays : int or str
        z, number of delayed copies of the inputs.
    ridge : float or "rollout"
        λ ≥ 0; zero takes the solution of least norm. "rollout" chooses λ per snapshot pair by the
        error of free runs on training runs that are held out in turn; it takes exact delay rows.
    window : int or str, optional
        m, snapshots per run; None takes all up to ``stop``.
    history : {"before", "inside"}, optional
        Whether the delay history of the first snapshot lies before the window or inside it.
    delay_rows : {"ridge", "exact"}, optional
        Whether the rows of Â that shift the delayed states are regressed like the others (the
        paper), or are the exact shift that they stand for.
    ridge_scale : {"absolute", "per_snapshot"}, optional
        Whether λ is what is added to the diagonal, or that divided by the number of columns.
    rank : int, optional
        Number of singular values kept, for exact DMD by truncated SVD instead of λ.
    standardize : bool, optional
        Whether channels are centred and scaled by mean and standard deviation (ddof = 1) over
        the training windows, pooled over the runs.
    alignment : ProbeAlignment, optional
        Alignment of the wave input to the moving vessel, the same in fit and forecast; a mapping
        of its keys is taken too.
    lead : int or str, optional
        Look-ahead: the input up to j + lead drives the step from j to j + 1.
    observables : sequence of SlowSquares, Powers, Expression or tables, optional
        Further regressors, made of the aligned inputs.
    stable : bool or float, optional
        Clip the eigenvalues of Â outside a radius to it, after the regression: True is 0.999. The
        modes inside stay as they are, exact delay rows stay exact, and ``training.clipped`` and
        ``summary()`` say which were moved.
    readouts : mapping of str to {"auto", "wave"}, or "auto", optional
        Loads that are read off the forecast: a ridge regression (1e-2 per sample, standardised) on
        motions, hinges of the surge, and elevation and rate of the wave at one place, the line's.
        The waves are carried there by an alignment with ``surge="predicted"``; the place is the one
        whose regression errs least on training runs that are left out in turn. Where motions or
        wave leave the range of training, the forecast of the channel as a state takes over.
        ``"wave"`` does so; ``"auto"`` where that forecasts training runs that are held out better,
        by more than two standard errors of the gain and 2 % of the error. Alone, "auto" holds for
        every load among the states (in N, kN or MN). A channel that rests on a floor in a hundredth
        of the training samples or more is not forecast below their 0.002 quantile, with either.
    memory : int or str, optional
        Longest delay of averages of the states, such as ``"8 T"``: beyond `state_delays` their
        means over blocks of delays that double in length are further regressors. It takes exact
        delay rows.
    centre : {"pooled", "run"} or length, optional
        Whether a model is one of departures from the means of all runs, or from those of each run:
        then a forecast takes the means of states and regressors over 30 encounter periods (or
        another length) before its start in their place, which is history that it needs. A surge
        that is followed stays as it is. For runs whose zeros differ; what drifts for long is lost.
    select : Select, optional
        What `fit` chooses by free runs beside λ; a mapping of its keys is taken too.
    parameter : str, optional
        Attribute of the runs, such as "draught", with which means and coefficients vary linearly;
        a dot leads into an attribute that is a mapping ("sea_state.Hs"). It takes runs at two
        values or more and exact delay rows. A forecast takes the value from its run. Where λ or
        something else is chosen, one pooled model is taken unless this one errs 5 % less on values
        that are held out, or with two values on second halves of the runs.

    Raises
    ------
    RequestError
        If a setting is out of range.

    Notes
    -----
    With more delays than the system has states the regressors are linearly dependent (or nearly,
    with noise): many pairs of Â and B̂ continue the data equally well, and which one is found is
    decided by λ, or by least norm at λ = 0. Forecasts then compare with another method's;
    coefficients, and the eigenvalues that the surplus delays bring, do not.

    Whether a model is stable is found when its eigenvalues are asked for (``summary()``,
    ``spectral_radius``, ``modes()``), and an unstable one warns then: no bound that is cheaper
    than the eigenvalues distinguishes a slowly decaying mode from a slowly growing one. A forecast
    that is lost says so in its ``status`` either way.

    Examples
    --------
    >>> HankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32).window
    640
    """

    kind: ClassVar[str] = "hankel_dmdc"
    model: ClassVar[type] = HankelDMDcModel
    n_members: ClassVar[int] = 1
    parameter: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.parameter and (
            self.delay_rows != "exact" or self.rank is not None or self.stable is not False
        ):
            raise RequestError(
                "parameter takes delay_rows = 'exact', no rank and stable = False; received "
                f"delay_rows = '{self.delay_rows}', rank = {self.rank}, stable = {self.stable}. "
                "Change them, or leave parameter out."
            )

    def needs(self, dt: float, encounter_period: float | None = None) -> Needs:
        """Samples that it asks of its runs, whichever observables are chosen."""
        if (select := self.select) is None:
            return super().needs(dt, encounter_period)
        spec, period = replace(self, select=None), encounter_period or select.period
        if select.observables and not self.observables:
            spec = replace(spec, observables=default_observables(("eta",), select.period))
        needs = spec.needs(dt, period)
        most = round(MEMORY * period / dt) if select.memory and period else 0
        return replace(needs, history=max(needs.history, most))

    @classmethod
    def paper(cls, encounter_period: float, dt: float) -> Self:
        """Settings of the paper: m 20, s 1 and z 5 encounter periods, λ = 100.

        Parameters
        ----------
        encounter_period : float
            Mean encounter period, s.
        dt : float
            Time step, s.

        Returns
        -------
        HankelDMDc
            At 32 samples a period: m = 640, s = 32, z = 160.
        """
        return cls(
            state_delays=periods_to_samples(1, encounter_period, dt),
            input_delays=periods_to_samples(5, encounter_period, dt),
            ridge=PAPER_RIDGE,
            window=periods_to_samples(20, encounter_period, dt),
        )

    @classmethod
    def recommended(
        cls,
        encounter_period: float,
        dt: float | None = None,
        runs: Runs | None = None,
        look_ahead: float = LEAD_PERIODS,
    ) -> Self:
        """Settings we recommend: what the data do not decide is stated, the rest `fit` chooses.

        Parameters
        ----------
        encounter_period : float
            Mean encounter period, s.
        dt : float, optional
            Time step, s; by default that of `runs`.
        runs : Dataset or collection of Datasets, optional
            Training runs, whose step this must be.
        look_ahead : float, optional
            How far ahead waves are read, encounter periods. Below 0.56, a vessel whose surge is
            followed needs a probe up-wave, and its waves are those which that one has seen.

        Returns
        -------
        HankelDMDc
            All of the runs, exact delay rows, s one period, z three periods, waves carried by
            dispersion to the surge that the model predicts step by step, where surge is a state
            and the runs state water depth and positions of the probes.
            Observables (none, slow squares and powers of the elevations, or both), whether waves
            are carried and read ahead at all, a memory of eight periods or none, λ, and read-outs
            of the loads are chosen by free runs of 15 and 45 periods on training runs that are held
            out in turn: the simplest that errs at most 5 % more than the best, or is as good
            but for the noise. Where nothing can be held out there are no observables, and λ is
            1e-3 per snapshot pair.
        """
        step = _step_of(dt, runs)

        def samples(periods: float) -> int:
            return periods_to_samples(periods, encounter_period, step)

        return cls(
            state_delays=samples(STATE_PERIODS),
            input_delays=samples(INPUT_PERIODS),
            lead=samples(look_ahead),
            **_open_settings(encounter_period),
        )

    def central(self, dt: float) -> HankelDMDc:
        """Itself: the single model at the middle of what is fitted."""
        return self

    def _adopt(self, choice: Selected[HankelDMDc]) -> Selected[HankelDMDc]:
        return replace(choice, settings=replace(choice.settings, select=None))

    def variants(self, given: TrainingRuns, *settings: HankelDMDc) -> list[tuple[HankelDMDc, str]]:
        """As stated; with a parameter those that err 5 % less than the best pooled one, and that.

        With three values or more, all runs of an inner value are held out in turn; with two, the
        second half of each run.
        """
        if not self.parameter:
            return [(each, "") for each in settings]
        runs = given.runs
        every = [replace(each, parameter="") for each in settings]
        parts = SMALLER if isinstance(self.ridge, str) or len(settings) > 1 else (1.0,)
        varying = [
            replace(each, ridge=float(f"{part * float(each.ridge):.6g}"))
            for each in settings
            for part in parts
        ]
        values = {name: parameter_of(run, self.parameter, name) for name, run in runs.items()}
        inner = sorted(set(values.values()))[1:-1]
        steps = round(HORIZON * labelled.mean_period(runs, given.inputs))
        halves = labelled.first_halves(runs)
        folds = [
            ({n: runs[n] for n in runs if values[n] != out}, [n for n in runs if values[n] == out])
            for out in inner
        ] or [(halves, list(runs))]
        errors: dict[HankelDMDc, list[float]] = {each: [] for each in (*every, *varying)}
        with quiet():
            for (training, judged), each in itertools.product(folds, errors):
                model = each._fitted(given._replace(runs=training), ())
                for name in judged:
                    errors[each] += _window_scores(model, runs[name], name, steps, not inner)
        means = {each: float(np.mean(scores)) for each, scores in errors.items()}
        pooled, order = min(every, key=means.__getitem__), sorted(varying, key=means.__getitem__)
        better = [each for each in order if means[each] < BETTER * means[pooled]]
        what = "runs of inner values" if inner else "second halves of the runs"
        return [
            (
                taken,
                f"on {what} that are held out, a model that varies with {self.parameter} errs "
                f"{means[each]:.3f} ({each.ridge_text(float(each.ridge))}) and a pooled one "
                f"{means[pooled]:.3f}; pooled unless the other errs 5 % less and does not grow\n",
            )
            for taken, each in zip((*better, pooled), (*better, order[0]), strict=True)
        ]

    def _fitted(self, given: TrainingRuns, readouts: tuple[FittedReadOut, ...]) -> HankelDMDcModel:
        data, runs, variation = gather(given, self), given.runs, None
        if self.parameter:
            values = [parameter_of(run, self.parameter, name) for name, run in runs.items()]
            solution, data, variation = regress_varying(data, self, self.parameter, values)
        else:
            solution = data.regress(self)
        model = HankelDMDcModel.fitted(self, data, solution, runs, readouts)
        return replace(model, variation=variation)


def _window_scores(
    model: HankelDMDcModel, run: xr.Dataset, name: str, steps: int, is_half: bool
) -> list[float]:
    """Scores of windows end to end, of the second half or of the whole run."""
    starts = model.judged_starts(run, steps, is_half * run.sizes["time"] // 2)
    if not starts:
        raise DataError(
            f"{name} is too short to judge whether the parameter is worth its coefficients: no "
            f"window of {steps} samples can be forecast. Train on longer runs, or state ridge."
        )
    predicted, measured = model.judged_runs(run, name, starts, steps)
    runs = FreeRuns(predicted[None], measured, model.signature.state_scale.spread)
    return scores_of(runs)[0].tolist()


def largest_radius(model: HankelDMDcModel) -> float:
    """Spectral radius, the largest over the trained range of a parameter."""
    return max(spectral_radius(each.dynamics) for each in model.over_range)


WINDOW = Uniform("60 T", "120 T")
"""What a member learns from where runs are long.

Members that learn from windows of one run each differ most where the waves are unlike those of the
training (docs/howto/bands.md)."""


@dataclass(frozen=True)
class BayesianHankelDMDc(Choosing[HankelEnsemble]):
    r"""Settings of a Bayesian ensemble of Hankel models (paper, section UQ through ensembling).

    The settings are those of :class:`HankelDMDc`; window, delays and ridge may be priors. These are
    pushed forward: each member is a :class:`HankelDMDc` with settings drawn from them, and the
    spread of the members' forecasts is the uncertainty (paper, equations of :math:`\mu[x(t)]` and
    :math:`\sigma[x(t)]`). There is no likelihood: "Bayesian" is the paper's word, and a band holds
    what the members differ in, not noise or model error: judge its coverage before you trust it.
    With ``train_on`` members also, or only, differ in the data they saw: a frequentist ensemble.

    Parameters
    ----------
    state_delays, input_delays : prior, int or str
        As in :class:`HankelDMDc`, such as ``Uniform("0.5 T", "1.5 T")``.
    ridge : prior, float or "rollout"
        λ. "rollout" chooses one by free runs, as :class:`HankelDMDc` does at the medians of the
        delays, and draws log-uniformly over a third to three times that.
    window : prior, int or str, optional
        Length of the training window; None takes all of a run up to ``stop``.
    encounter_period : float, optional
        Mean encounter period, s; by default that of the training runs.
    n_members : int, optional
        Number of members.
    seed : int, SeedSequence or Generator, optional
        Root of the members' generators. A Generator gives one number, when the settings are made.
    sampling : {"monte_carlo", "sobol"}, optional
        Independent points, or a scrambled Sobol net.
    train_on : {"all", "runs", "windows", "auto"}, optional
        What a member learns from: the windows at ``stop`` in all runs together (the paper); that
        in one run, drawn for each member; or a window that ends anywhere up to ``stop`` in one run.
        "auto" takes windows of 60 to 120 encounter periods where there are several runs, each lasts
        120, and none is of regular waves (``attrs["waves"]``), and all runs otherwise.
    centred : bool, optional
        Whether the members are moved so that their mean is the forecast of the single model at the
        medians of the priors, of all of the runs up to ``stop``; their spread stays. Members that
        learn from windows have a mean that is worse than that model.
    dt : float, optional
        Time step the runs must have, s; None takes theirs.
    lead, history, delay_rows, ridge_scale, rank, standardize, observables, stable, memory, centre
        As in :class:`HankelDMDc`.
    select
        As in :class:`HankelDMDc`.
    alignment
        As in :class:`HankelDMDc`. What an alignment estimates, it estimates once for all members,
        from all that is given up to ``stop``: no member's draw moves another's input.
    readouts
        As in :class:`HankelDMDc`; fitted once, with the medians of the priors, for all members.

    Raises
    ------
    RequestError
        If a setting is out of range.

    Examples
    --------
    >>> spec = BayesianHankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32)
    >>> spec.n_members, spec.window
    (100, Uniform(low='10 T', high='30 T'))
    """

    kind: ClassVar[str] = "bayesian_hankel_dmdc"
    is_ensemble: ClassVar[bool] = True
    state_delays: Prior | int  # type: ignore[assignment]
    input_delays: Prior | int  # type: ignore[assignment]
    ridge: Prior | float | Literal["rollout"]  # type: ignore[assignment]
    window: Prior | int | None = None  # type: ignore[assignment]
    encounter_period: float | None = None
    n_members: int = 100
    seed: int | str | np.random.SeedSequence | np.random.Generator = 0
    sampling: Sampling = "monte_carlo"
    train_on: TrainOn = "all"
    centred: bool = False
    dt: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number(self.n_members, "n_members")
        if (period := self.encounter_period) is not None:
            # Without dt any step shorter than the period will do; the runs' own is checked at fit.
            periods_to_samples(1, period, self.dt or 0.5 * period)
        check_choice("sampling", self.sampling, ("monte_carlo", "sobol"))
        check_choice("train_on", self.train_on, get_args(TrainOn))
        check_flag("centred", self.centred)
        if isinstance(seed := self.seed, np.random.Generator):
            object.__setattr__(self, "seed", int(seed.integers(2**63)))
        _seed_sequence(self.seed)

    @property
    def seed_sequence(self) -> np.random.SeedSequence:
        """Root of the members' generators."""
        return _seed_sequence(self.seed)

    def _read(self, name: str) -> Any:
        prior = prior_of(name, getattr(self, name)) if name in PRIORS else None
        return super()._read(name) if prior is None else prior

    def at(self, name: str, q: float) -> float | None:
        """Quantile of a setting, in the unit of its prior; a value is its own."""
        stated = getattr(self, name)
        if isinstance(stated, Prior):
            return float(stated.ppf(q))
        return float(stated.value) if isinstance(stated, Length) else stated

    def samples(self, name: str, value: float, dt: float) -> int:
        """Samples of a length that :meth:`at` returns."""
        unit: Any = getattr(getattr(self, name), "unit", "")
        return in_samples(Length(value, unit) if unit else value, dt, self.encounter_period)

    def shared(self, dt: float) -> HankelDMDc:
        """What all members share; its delays, window and λ are not used."""
        own = {each.name: getattr(self, each.name) for each in fields(HankelSettings)}
        unused = {"state_delays": 0, "input_delays": 0, "ridge": 0.0, "window": None}
        return HankelDMDc(**own | unused).resolved(dt, self.encounter_period)

    def central(self, dt: float) -> HankelDMDc:
        """The single model at the medians of the priors."""
        return self._single(0.5, dt)

    def centred_on(self, dt: float) -> Draw | None:
        """The single model of all runs that members are centred on, if they are."""
        if not self.centred:
            return None
        whole = replace(self.central(dt), window=None, select=None)
        return Draw(whole, (np.nan, whole.state_delays, whole.input_delays))

    def _single(self, q: float, dt: float) -> HankelDMDc:
        """The single model at a quantile of the window and delays, with the median of λ."""
        values: Json = {}
        for name in PRIORS[:3]:
            value = self.at(name, q)
            if value is not None and not np.isfinite(value):
                value = self.at(name, 1.0 - 1e-6)  # of a prior without an upper end
            values[name] = None if value is None else self.samples(name, value, dt)
        values["ridge"] = self.ridge if isinstance(self.ridge, str) else self.at("ridge", 0.5)
        return replace(self.shared(dt), **values, select=self.select)

    def needs(self, dt: float, encounter_period: float | None = None) -> Needs:
        """Samples that its largest draw asks of its runs: the upper ends of the priors count."""
        return self._single(1.0, dt).needs(dt, self.encounter_period or encounter_period)

    def to_json(self) -> Json:
        """Settings as JSON values; the seed as entropy, and the spawn key behind strokes."""
        root = self.seed_sequence
        numbers = (root.entropy, *root.spawn_key)
        written: Any = "/".join(map(str, numbers)) if root.spawn_key else root.entropy
        return HankelSettings.to_json(replace(self, seed=written))

    @classmethod
    def restore(cls, dataset: xr.Dataset) -> HankelEnsemble:
        """Rebuild the ensemble that a file holds."""
        spec = cls.from_json(store.content(dataset, "ensemble"))
        dt = store.content(dataset, "signature")["dt"]
        settings = spec.shared(dt)
        return store.restored(
            HankelEnsemble,
            dataset,
            settings=settings,
            origin=spec.to_json(),
            members=draws_of(dataset, settings),
            centre=spec.centred_on(dt),
        )

    @classmethod
    def paper(
        cls,
        encounter_period: float,
        dt: float | None = None,
        n_members: int = 100,
        seed: int | np.random.SeedSequence | np.random.Generator = 0,
    ) -> Self:
        """Priors of the paper: ±50 % around its deterministic settings, uniform.

        Parameters
        ----------
        encounter_period : float
            Mean encounter period, s.
        dt : float, optional
            Time step the runs must have, s.
        n_members, seed
            As in the class.

        Returns
        -------
        BayesianHankelDMDc
            Lengths of 10–30, 0.5–1.5 and 2.5–7.5 encounter periods, λ of 50–150, all else as in
            :meth:`HankelDMDc.paper`.
        """
        return cls(
            encounter_period=encounter_period,
            window=Uniform("10 T", "30 T"),
            state_delays=Uniform("0.5 T", "1.5 T"),
            input_delays=Uniform("2.5 T", "7.5 T"),
            ridge=Uniform(50, 150),
            n_members=n_members,
            seed=seed,
            dt=dt,
        )

    @classmethod
    def recommended(
        cls,
        encounter_period: float,
        dt: float | None = None,
        n_members: int = 100,
        seed: int | np.random.SeedSequence | np.random.Generator = 0,
        runs: Runs | None = None,
    ) -> Self:
        """Priors around :meth:`HankelDMDc.recommended`.

        Parameters
        ----------
        encounter_period, dt, n_members, seed
            As in :meth:`paper`.
        runs
            As in :meth:`HankelDMDc.recommended`.

        Returns
        -------
        BayesianHankelDMDc
            As there, with half to one and a half times the delay of the states, two to four
            periods of the inputs, a third to three times the λ that free runs choose, and members
            that learn from windows of long runs (``train_on = "auto"``), centred on the single
            model.
        """
        return cls(
            encounter_period=encounter_period,
            state_delays=Uniform("0.5 T", "1.5 T"),
            input_delays=Uniform("2 T", "4 T"),
            n_members=n_members,
            seed=seed,
            dt=dt if runs is None else _step_of(dt, runs),
            lead=Length(LEAD_PERIODS),  # type: ignore[arg-type]
            train_on="auto",
            centred=True,
            **_open_settings(encounter_period),
        )

    def _adopt(self, choice: Selected[HankelDMDc]) -> Selected[BayesianHankelDMDc]:
        """Priors around what :meth:`central` found."""
        ridge, scale = self.ridge, self.ridge_scale
        if isinstance(ridge, str):
            best = float(choice.settings.ridge)
            ridge, scale = LogUniform(best / 3.0, best * 3.0), "per_snapshot"
        spec = replace(
            self,
            ridge=ridge,
            ridge_scale=scale,
            **{name: getattr(choice.settings, name) for name in (*OPENED, "readouts")},
            select=None,
        )
        return Selected(spec, choice.rows, choice.note, choice.readouts)

    def resolved_in(self, runs: Datasets, inputs: Sequence[str]) -> Self:
        """Settings with the encounter period of some runs, where it counts and none is stated."""
        dt, period = _step_of(self.dt, runs), self.encounter_period
        if period is None and (self.in_periods or self.train_on == "auto"):
            period = labelled.mean_period(runs, inputs) * dt
        return replace(self, encounter_period=period).resolved(dt, period)

    def _taught_by(self, runs: Collection[xr.Dataset], shortest: float) -> BayesianHankelDMDc:
        """Settings that say what members learn from; `shortest` is the time of a run, s."""
        if self.train_on != "auto":
            return self
        assert self.encounter_period is not None
        long = len(runs) > 1 and shortest >= WINDOW.bounds[1] * self.encounter_period
        if not long or any(run.attrs.get("waves") == "regular" for run in runs):
            return replace(self, train_on="all")
        return replace(self, train_on="windows", window=self.window or WINDOW)

    def _fitted(self, given: TrainingRuns, readouts: tuple[FittedReadOut, ...]) -> HankelEnsemble:
        runs, states, inputs = given
        dt = labelled.common_step(runs)
        shared = self.shared(dt)
        labels = labelled.common_labels(runs, states), labelled.common_labels(runs, inputs)
        input_map = shared.input_map(given, None)
        samples = [run.sizes["time"] for run in runs.values()]
        spec = self._taught_by(runs.values(), min(samples) * dt)
        members, centre = draw_members(spec, dt, samples, input_map), spec.centred_on(dt)
        every = members if centre is None else [*members, centre]
        firsts = [
            min(draw.first(run, count, input_map) for draw in every)
            for run, count in enumerate(samples)
        ]
        arrays = [
            RunArrays.read(given, name, first, input_map)
            for name, first in zip(runs, firsts, strict=True)
        ]
        trained = [
            labelled.channel_matrix(runs[each.name], inputs, each.name, slice(each.offset, None))
            for each in arrays
            if len(each.states)
        ]
        # Direct regressors have no value where they need inputs from before the record; no member
        # reads them there.
        series: Any = [
            (each.states, each.delayed, each.direct[np.isfinite(each.direct).all(axis=1)])
            for each in arrays
        ]
        if shared.centre:
            series = departing(series, input_map)
        groups = (labels[0], *input_map.regressors(labels[1]))
        x, u, w = (
            moments(each, group, standardize=False)
            for each, group in zip(zip(*series, strict=True), groups, strict=True)
        )
        s = max(draw.settings.state_reach for draw in every)
        z = max(draw.settings.input_delays for draw in every)
        input_map = replace(input_map, reference=shared.centre)
        signature = Signature(dt, *labels, s, z, input_map, x, u, w, readouts)
        return HankelEnsemble(
            settings=shared,
            origin=spec.to_json(),
            members=tuple(members),
            arrays=tuple(replace(each, direct=np.nan_to_num(each.direct)) for each in arrays),
            signature=signature,
            coverage=Coverage.of(inputs, trained, dt),
            centre=centre,
        )


def left_open(spec: Spec) -> HankelDMDc | BayesianHankelDMDc | None:
    """The spec, where it leaves something to be chosen by free runs."""
    return spec if isinstance(spec, HankelDMDc | BayesianHankelDMDc) and spec.is_open else None


def _open_settings(encounter_period: float) -> Json:
    """What both kinds of models that we recommend share; free runs choose in it."""
    return {
        "ridge": "rollout",
        "delay_rows": "exact",
        "ridge_scale": "per_snapshot",
        "alignment": ALIGNMENT,
        "readouts": "auto",
        "select": Select(True, True, True, True, period=encounter_period),
    }


def _seed_sequence(seed: object) -> np.random.SeedSequence:
    if isinstance(seed, np.random.SeedSequence):
        return seed
    if isinstance(seed, str):  # of a file
        entropy, *key = (int(each) for each in seed.split("/"))
        return np.random.SeedSequence(entropy, spawn_key=key)
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise RequestError(
            f"seed must be an integer, zero or more, a SeedSequence or a Generator of numpy; "
            f"received {seed!r:.{SHOWN}}."
        )
    return np.random.SeedSequence(int(seed))


def _step_of(dt: float | None, runs: Runs | None) -> float:
    """Time step that is stated, which must be that of runs, or theirs."""
    if runs is None:
        if dt is None:
            raise RequestError("neither dt (s) nor runs are given. Give one of them.")
        return dt
    runs = as_runs(runs)
    step = labelled.common_step(runs)
    if dt is not None:
        labelled.run_step(*next((run, name) for name, run in runs.items()), dt)
    return step
