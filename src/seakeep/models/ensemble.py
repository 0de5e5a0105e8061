"""The Bayesian and the frequentist ensemble of Hankel models: what a user sets, and its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError
from seakeep.models import labelled
from seakeep.models.aligned import align_training
from seakeep.models.alignment import ProbeAlignment
from seakeep.models.checks import check_choice
from seakeep.models.draws import Sampling, TrainOn, draw_members
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.models.identification import Stop, check_names, last_sample, stop_instants, until
from seakeep.models.labelled import Runs, as_runs
from seakeep.models.members import TrainingArrays, reach
from seakeep.models.priors import LogUniform, Prior, Uniform, check_prior, describe
from seakeep.models.settings import (
    DelayRows,
    HankelSettings,
    History,
    RidgeScale,
    check_integer,
    periods_to_samples,
)

__all__ = ["BayesianHankelDMDc"]

PAPER_RIDGE_PER_SNAPSHOT = 100.0 / 640


@dataclass(frozen=True)
class BayesianHankelDMDc:
    r"""Settings of a Bayesian ensemble of Hankel models (paper, section UQ through ensembling).

    Priors over training length, delays and ridge are pushed forward: each member is a
    :class:`HankelDMDc` with settings drawn from them, and the spread of the members' forecasts is
    the uncertainty (paper, equations of :math:`\mu[x(t)]` and :math:`\sigma[x(t)]`). There is no
    likelihood: "Bayesian" is the paper's word, and a band holds what the members differ in, not
    noise or model error: judge its coverage before you trust it. With ``train_on`` members also,
    or only, differ in the data they saw: a frequentist ensemble.

    Parameters
    ----------
    encounter_period : float
        Mean encounter period, s.
    train_length : prior or None
        Length of the training window, encounter periods; None takes all of a run up to ``stop``.
    state_delay, input_delay : prior
        Longest delay of states and inputs, encounter periods.
    ridge : prior
        λ.
    n_members : int, optional
        Number of members.
    seed : int, SeedSequence or Generator, optional
        Root of the members' generators. A Generator gives one number, when the settings are made.
    sampling : {"monte_carlo", "sobol"}, optional
        Independent points, or a scrambled Sobol net.
    train_on : {"all", "runs", "windows"}, optional
        What a member learns from: the windows at ``stop`` in all runs together (the paper); that
        in one run, drawn for each member; or a window that ends anywhere up to ``stop`` in one run.
    dt : float, optional
        Time step the runs must have, s; None takes theirs.
    history, delay_rows, ridge_scale, rank, standardize, alignment
        As in :class:`HankelDMDc`. What an alignment estimates, it estimates once for all members,
        from all that is given up to ``stop``: no member's draw moves another's input.

    Raises
    ------
    RequestError
        If a setting is out of range, or not a prior.

    Examples
    --------
    >>> spec = BayesianHankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32)
    >>> spec.n_members, spec.train_length
    (100, Uniform(low=10, high=30))
    """

    encounter_period: float
    train_length: Prior | None
    state_delay: Prior
    input_delay: Prior
    ridge: Prior
    n_members: int = 100
    seed: int | np.random.SeedSequence | np.random.Generator = 0
    sampling: Sampling = "monte_carlo"
    train_on: TrainOn = "all"
    dt: float | None = None
    history: History = "before"
    delay_rows: DelayRows = "ridge"
    ridge_scale: RidgeScale = "absolute"
    rank: int | None = None
    standardize: bool = True
    alignment: ProbeAlignment | None = None
    seed_sequence: np.random.SeedSequence = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("train_length", "state_delay", "input_delay", "ridge"):
            if name != "train_length" or self.train_length is not None:
                check_prior(name, getattr(self, name))
        check_integer("n_members", self.n_members, 1)
        periods_to_samples(1, self.encounter_period, self.dt if self.dt is not None else 1.0)
        check_choice("sampling", self.sampling, ("monte_carlo", "sobol"))
        check_choice("train_on", self.train_on, ("all", "runs", "windows"))
        object.__setattr__(self, "alignment", self.shared.alignment)
        object.__setattr__(self, "seed_sequence", _seed_sequence(self.seed))

    @property
    def shared(self) -> HankelSettings:
        """What all members share; delays, window and λ in it stand for nothing."""
        return HankelSettings(
            state_delays=0,
            input_delays=0,
            ridge=0.0,
            history=self.history,
            delay_rows=self.delay_rows,
            ridge_scale=self.ridge_scale,
            rank=self.rank,
            standardize=self.standardize,
            alignment=self.alignment,
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
            train_length=Uniform(10, 30),
            state_delay=Uniform(0.5, 1.5),
            input_delay=Uniform(2.5, 7.5),
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
    ) -> Self:
        """Priors around :meth:`HankelDMDc.recommended`.

        Parameters
        ----------
        encounter_period, dt, n_members, seed
            As in :meth:`paper`.

        Returns
        -------
        BayesianHankelDMDc
            All of the runs, the paper's delays, exact delay rows, and a ridge per snapshot,
            log-uniform over 0.3 to 3 times 100/640.
        """
        return cls(
            encounter_period=encounter_period,
            train_length=None,
            state_delay=Uniform(0.5, 1.5),
            input_delay=Uniform(2.5, 7.5),
            ridge=LogUniform(0.3 * PAPER_RIDGE_PER_SNAPSHOT, 3 * PAPER_RIDGE_PER_SNAPSHOT),
            n_members=n_members,
            seed=seed,
            dt=dt,
            delay_rows="exact",
            ridge_scale="per_snapshot",
        )

    def fit(
        self,
        runs: Runs,
        states: Sequence[str],
        inputs: Sequence[str],
        stop: Stop = None,
    ) -> HankelEnsemble:
        """Draw the members and gather what they learn from; their matrices are made on demand.

        Parameters
        ----------
        runs, states, inputs, stop
            As in :meth:`HankelDMDc.fit`.

        Returns
        -------
        HankelEnsemble
            The ensemble, immutable. The same settings give the same draws for every training
            window that all of them fit into.

        Raises
        ------
        RequestError, DataError
            As :meth:`HankelDMDc.fit`; DataError too if no draw fits the runs.
        """
        named = as_runs(runs)
        check_names(states, inputs)
        fitted = None
        if self.alignment is not None:
            named, stop = until(named, stop), None
            fitted, named = align_training(self.alignment, named, states, inputs, None, 0)
        stops = stop_instants(stop, list(named))
        first_name, first_run = next(iter(named.items()))
        dt = labelled.run_step(first_run, first_name)
        if self.dt is not None:
            labelled.check_step(first_run, first_name, self.dt)
        lasts = []
        for name, run in named.items():
            labelled.check_step(run, name, dt)
            time = np.asarray(run["time"].values, dtype=float)
            lasts.append(last_sample(time, stops[name], name))
        samples = [last + 1 for last in lasts]
        members = draw_members(self, dt, samples)
        earliest = reach(members, samples, self.history == "inside")
        arrays, labels = _training_arrays(named, states, inputs, samples, earliest)
        return HankelEnsemble(
            settings=self.shared,
            origin=_origin(self),
            members=tuple(members),
            arrays=arrays,
            dt=dt,
            state_labels=labels[0],
            input_labels=labels[1],
            alignment=fitted,
        )


def _seed_sequence(seed: object) -> np.random.SeedSequence:
    if isinstance(seed, np.random.SeedSequence):
        return seed
    if isinstance(seed, np.random.Generator):
        return np.random.SeedSequence(int(seed.integers(2**63)))
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise RequestError(
            f"seed must be an integer, zero or more, a SeedSequence or a Generator of numpy; "
            f"received {seed!r}."
        )
    return np.random.SeedSequence(int(seed))


def _training_arrays(
    runs: dict[str, Any],
    states: Sequence[str],
    inputs: Sequence[str],
    samples: Sequence[int],
    earliest: Sequence[int],
) -> tuple[TrainingArrays, tuple[tuple[labelled.ChannelLabel, ...], ...]]:
    labels: tuple[tuple[labelled.ChannelLabel, ...], ...] = ()
    read: list[list[npt.NDArray[np.float64]]] = []
    begins = []
    for (name, run), first, end in zip(runs.items(), earliest, samples, strict=True):
        time = np.asarray(run["time"].values, dtype=float)
        pair = []
        for channels in (states, inputs):
            values = labelled.channel_matrix(run, channels, name, slice(first, end))
            labelled.check_finite(values, channels, name, first, time)
            values.flags.writeable = False
            pair.append(values)
        labels = labels or tuple(labelled.channel_labels(run, names) for names in (states, inputs))
        for group in labels:
            labelled.check_units(run, group, name)
        read.append(pair)
        begins.append(float(time[min(first, time.size - 1)]))
    arrays = TrainingArrays(
        names=tuple(runs),
        states=tuple(pair[0] for pair in read),
        inputs=tuple(pair[1] for pair in read),
        offsets=tuple(earliest),
        begins=tuple(begins),
        state_names=tuple(states),
        input_names=tuple(inputs),
    )
    return arrays, labels


def _origin(spec: BayesianHankelDMDc) -> dict[str, Any]:
    """What made the draws, as plain data: for the attributes of files and results."""
    seed = spec.seed_sequence
    return {
        "encounter_period": float(spec.encounter_period),
        "train_length": describe(spec.train_length),
        "state_delay": describe(spec.state_delay),
        "input_delay": describe(spec.input_delay),
        "ridge": describe(spec.ridge),
        "n_members": int(spec.n_members),
        "seed": str(seed.entropy),
        "spawn_key": [int(key) for key in seed.spawn_key],
        "sampling": spec.sampling,
        "train_on": spec.train_on,
    }
