"""Hankel dynamic mode decomposition with control: what a user sets, and its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from seakeep.core.solve import identify
from seakeep.models.aligned import align_training
from seakeep.models.identification import Stop, check_names, gather, until
from seakeep.models.labelled import Runs, as_runs
from seakeep.models.model import HankelDMDcModel
from seakeep.models.settings import HankelSettings, periods_to_samples
from seakeep.models.training import Training

__all__ = ["HankelDMDc"]

PAPER_RIDGE = 100.0
PAPER_SNAPSHOTS = 640


@dataclass(frozen=True)
class HankelDMDc(HankelSettings):
    r"""Settings of a Hankel dynamic mode decomposition with control.

    The model is :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j` with
    :math:`\hat x_j = [x_j; …; x_{j-s}]`, :math:`\hat u_j = [u_j; …; u_{j-z}]`, and
    :math:`[\hat A\; \hat B] = \hat X' \hat Y^T (\hat Y \hat Y^T + \lambda I)^{-1}` on
    standardised deviations (paper, section HDMDc).

    Parameters
    ----------
    state_delays : int
        s, number of delayed copies of the states.
    input_delays : int
        z, number of delayed copies of the inputs.
    ridge : float
        λ ≥ 0; zero takes the solution of least norm.
    window : int, optional
        m, snapshots a run; None takes all up to ``stop``.
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
    than the eigenvalues tells a slowly decaying mode from a slowly growing one. A forecast that
    is lost says so in its ``status`` either way.

    Examples
    --------
    >>> HankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32).window
    640
    """

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
    def recommended(cls, encounter_period: float, dt: float) -> Self:
        """Settings we recommend: as the paper, but all of the runs, exact rows, λ per snapshot.

        Parameters
        ----------
        encounter_period : float
            Mean encounter period, s.
        dt : float
            Time step, s.

        Returns
        -------
        HankelDMDc
            s one period, z five periods, λ = 100/640 times the number of columns.
        """
        return cls(
            state_delays=periods_to_samples(1, encounter_period, dt),
            input_delays=periods_to_samples(5, encounter_period, dt),
            ridge=PAPER_RIDGE / PAPER_SNAPSHOTS,
            delay_rows="exact",
            ridge_scale="per_snapshot",
        )

    def fit(
        self,
        runs: Runs,
        states: Sequence[str],
        inputs: Sequence[str],
        stop: Stop = None,
    ) -> HankelDMDcModel:
        """Identify a model; the settings are not changed by it.

        Parameters
        ----------
        runs : Dataset, sequence of Dataset, or mapping of names to Datasets
            Runs with the dimension ``time`` (s, uniform, the same step in all) and one variable
            a channel. Several are pooled.
        states : sequence of str
            Channels to forecast.
        inputs : sequence of str
            Channels that drive them; may be empty (autonomous Hankel DMD).
        stop : float, sequence or mapping of float, optional
            Last instant of the training window, s; one for all runs, or one a run. By default
            each run's end.

        Returns
        -------
        HankelDMDcModel
            The model, immutable.

        Raises
        ------
        RequestError
            If a channel is unknown, or `stop` lies outside a run.
        DataError
            If a run is too short, has gaps or times that are not uniform, another step than the
            first, or a constant channel while ``standardize`` is set.
        """
        named, fitted = as_runs(runs), None
        if self.alignment is not None:
            check_names(states, inputs)
            named, stop = until(named, stop), None
            reach = 0 if self.history == "inside" else self.history_samples - 1
            fitted, named = align_training(
                self.alignment, named, states, inputs, self.window, reach
            )
        data = gather(
            named,
            states,
            inputs,
            stop,
            state_delays=self.state_delays,
            input_delays=self.input_delays,
            window=self.window,
            history=self.history,
            standardize=self.standardize,
        )
        solution = identify(
            data.states,
            data.inputs,
            data.windows,
            state_delays=self.state_delays,
            input_delays=self.input_delays,
            ridge=float(self.ridge),
            per_snapshot=self.ridge_scale == "per_snapshot",
            rank=self.rank,
            all_rows=self.delay_rows == "ridge",
        )
        return HankelDMDcModel(
            settings=self,
            coefficients=solution.coefficients,
            dt=data.dt,
            state_labels=data.state_labels,
            input_labels=data.input_labels,
            state_scale=data.state_scale,
            input_scale=data.input_scale,
            training=Training(
                runs=data.names,
                first=tuple(float(value) for value in data.first_instants),
                stop=tuple(float(value) for value in data.last_instants),
                columns=tuple(window.columns for window in data.windows),
                method=solution.method,
                ridge=solution.ridge,
                rank=solution.rank,
            ),
            alignment=fitted,
        )
