"""A fitted ensemble: its draws, its members on demand, their forecasts, and its file."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.models import ensemble_forecasts, ensemble_store, ensemble_summary, store
from seakeep.models.alignment import FittedAlignment
from seakeep.models.calibration import Band, Calibration, calibrate
from seakeep.models.draws import Draw
from seakeep.models.ensemble_summary import warn_of_unstable
from seakeep.models.executor import Progress, in_order
from seakeep.models.held import HeldEnsemble, hold
from seakeep.models.labelled import ChannelLabel, Runs
from seakeep.models.members import TrainingArrays, member_model, member_radius, window_ends
from seakeep.models.model import HankelDMDcModel
from seakeep.models.settings import HankelSettings

__all__ = ["HankelEnsemble"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HankelEnsemble:
    """Members that differ in their settings, or in what they learned from.

    Made by :meth:`BayesianHankelDMDc.fit` or :func:`seakeep.load_model`. It holds draws and
    training arrays; a member's matrices exist while it is at work, and no longer.

    Parameters
    ----------
    settings : HankelSettings
        What all members share.
    origin : dict
        Priors, seed and rules that made the draws, as plain data.
    members : tuple of Draw
        Settings of each member.
    arrays : TrainingArrays
        What they learn from.
    dt : float
        Time step, s.
    state_labels, input_labels : tuple of ChannelLabel
        Names and units of states and inputs.
    alignment : FittedAlignment, optional
        How the wave input is aligned to the vessel; the training arrays are aligned.
    radii : ndarray, shape (member,), optional
        Spectral radii of the members, once :meth:`spectral_radii` has found them.
    calibration : Calibration, optional
        By how much the calibrated band is wider than that of the members; see :meth:`calibrate`.
    """

    settings: HankelSettings
    origin: dict[str, Any]
    members: tuple[Draw, ...]
    arrays: TrainingArrays
    dt: float
    state_labels: tuple[ChannelLabel, ...]
    input_labels: tuple[ChannelLabel, ...]
    alignment: FittedAlignment | None = None
    radii: FloatArray | None = None
    calibration: Calibration | None = None

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(n_members={self.n_members}, states={self.states}, "
            f"inputs={self.inputs}, dt={self.dt:g}; print(ensemble.summary()) says more)"
        )

    @property
    def n_members(self) -> int:
        """Number of members."""
        return len(self.members)

    @property
    def states(self) -> list[str]:
        """Names of the states, in the order of the members."""
        return [label.name for label in self.state_labels]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs, in the order of the members."""
        return [label.name for label in self.input_labels]

    @property
    def state_delays(self) -> int:
        """Longest s of a member."""
        return max(draw.state_delays for draw in self.members)

    @property
    def input_delays(self) -> int:
        """Longest z of a member."""
        return max(draw.input_delays for draw in self.members)

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, so that every member has its history."""
        return max(self.state_delays, self.input_delays) + 1

    @cached_property
    def draws(self) -> xr.Dataset:
        """What was drawn, over ``member``.

        ``train_length``, ``state_delay`` and ``input_delay`` in encounter periods (NaN where all
        of a run trains), the integers ``…_samples`` they became (−1 for all of a run), ``ridge``,
        the run that trains (−1 for all) and its last sample (−1 for ``stop``), and how many
        infeasible draws came before.
        """
        return ensemble_store.draws_dataset(self.members, self.origin)

    @cached_property
    def state_spread(self) -> FloatArray:
        """Standard deviation of the states over all that members learn from, shape (N,)."""
        spread: FloatArray = np.concatenate(self.arrays.states).std(axis=0, ddof=1)
        return spread

    @cached_property
    def training_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant of the training windows in each run that trains a member, s."""
        spans: dict[str, tuple[float, float]] = {}
        for run, name in enumerate(self.arrays.names):
            ends = [
                window_ends(self.arrays, draw, run, self.dt)
                for draw in self.members
                if draw.run in (None, run)
            ]
            if ends:
                spans[name] = min(first for first, _ in ends), max(stop for _, stop in ends)
        return spans

    @cached_property
    def read_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant that any member reads of each run, delay history included, s."""
        arrays = self.arrays
        return {
            name: (begin, begin + (len(x) - 1) * self.dt)
            for name, begin, x in zip(arrays.names, arrays.begins, arrays.states, strict=True)
            if len(x)
        }

    def member(self, number: int) -> HankelDMDcModel:
        """One member as a model of its own.

        Parameters
        ----------
        number : int
            Which, from zero.

        Returns
        -------
        HankelDMDcModel
            Equal to :class:`HankelDMDc` with the member's settings and data.

        Raises
        ------
        RequestError
            If there is no such member.
        """
        return member_model(self, number)

    def spectral_radii(
        self,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FloatArray:
        """Largest modulus of an eigenvalue of each member; a member is stable below one.

        Found once: the ensemble keeps them, and its file does.

        Parameters
        ----------
        executor, progress
            As in :meth:`forecast`.

        Returns
        -------
        ndarray, shape (member,)

        Warns
        -----
        SeakeepWarning
            When they are found, if one or more are not below one.
        """
        if self.radii is None:
            data = (self.arrays, self.settings)
            radii = np.array(list(in_order(member_radius, data, self.members, executor, progress)))
            radii.flags.writeable = False
            object.__setattr__(self, "radii", radii)
            warn_of_unstable(radii)
        assert self.radii is not None
        return self.radii

    def summary(self) -> str:
        """Text that says what the ensemble is made of, and how stable its members are.

        Returns
        -------
        str
            A few lines; the first reading finds the :meth:`spectral_radii`.
        """
        return ensemble_summary.summary(self)

    def forecast(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Free runs of all members.

        Parameters
        ----------
        run, start, steps
            As in :meth:`HankelDMDcModel.forecast`.
        executor : concurrent.futures.Executor, optional
            Who identifies and runs the members: :func:`seakeep.models.processes`, or Dask's
            ``client.get_executor()``; by default this process. The result does not depend on it.
        progress : callable, optional
            Called as ``progress(done, total, what)`` after each member.

        Returns
        -------
        Dataset
            States with dimensions (member, time), and ``status`` over ``member``. A member that
            diverges is NaN from there on.

        Raises
        ------
        RequestError, DataError
            As :meth:`HankelDMDcModel.forecast`.
        """
        return ensemble_forecasts.all_members(self, run, start, steps, executor, progress)

    def forecast_summary(
        self,
        run: xr.Dataset,
        start: float,
        steps: int | None = None,
        level: float = 0.95,
        *,
        band: Band = "members",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Mean, standard deviation and band of the members, never all of them at once.

        Parameters
        ----------
        run, start, steps, executor, progress
            As in :meth:`forecast`.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band : {"members", "calibrated"}, optional
            Quantiles of the members, or these moved outwards as :meth:`calibrate` found.

        Returns
        -------
        Dataset
            As :func:`seakeep.summarize` makes of :meth:`forecast`, dimensions (statistic, time),
            with ``status`` over ``member``. More than 32 MiB of members are spilled to a
            temporary file and reduced in pieces of time.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        return ensemble_forecasts.summary(self, run, start, steps, level, band, executor, progress)

    def hold(
        self,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> HeldEnsemble:
        """Identify all members once and keep them, for forecasts in a loop or on board.

        Parameters
        ----------
        executor, progress
            As in :meth:`forecast`.

        Returns
        -------
        HeldEnsemble
            Its ``forecast_arrays`` gives mean and band from plain arrays. It takes N(N(s+1) +
            Q(z+1)) numbers a member with exact delay rows, and s + 1 times as many with
            regressed ones.

        Raises
        ------
        RequestError
            If the members carry the waves to the surge that they predict.
        """
        return hold(self, executor, progress)

    def calibrate(
        self,
        runs: Runs,
        steps: int,
        level: float = 0.95,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Widen the band so that it holds unseen measurements as often as it says.

        The band forecasts windows end to end in `runs` that no member has read, and is moved
        outwards, channel by channel, by a quantile of how far measurements lie outside of it
        (:func:`seakeep.statistics.conformal_margin`, which says what that warrants and what not).

        Parameters
        ----------
        runs : Dataset, sequence of Dataset, or mapping of names to Datasets
            Runs of the same sea, or parts of them, under the names by which they trained. Leave
            out what the ensemble is to be tested on.
        steps : int
            Instants of a window: as many as will be forecast.
        level : float, optional
            Probability that the band is to have.
        executor, progress
            As in :meth:`forecast`; a step is a member in one of the runs.

        Returns
        -------
        HankelEnsemble
            The same members, with the :attr:`calibration` that ``band="calibrated"`` uses.

        Raises
        ------
        RequestError
            If there is no such window, or a setting is out of range.
        DataError
            If a run cannot be used.
        """
        return replace(self, calibration=calibrate(self, runs, steps, level, executor, progress))

    def forecast_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        *,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Free runs of all members from several starts side by side.

        Parameters
        ----------
        run, steps, executor, progress
            As in :meth:`forecast`; `steps` holds for all.
        starts : sequence of float
            Instants of the last measured state, s.

        Returns
        -------
        Dataset
            States with dimensions (window, member, lead), ``lead`` in s after each ``start``
            (over ``window``), and ``status`` over (window, member).

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        return ensemble_forecasts.all_members_of_windows(
            self, run, starts, steps, executor, progress
        )

    def summarize_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        level: float = 0.95,
        *,
        band: Band = "members",
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Mean, standard deviation and band from several starts, never all members at once.

        Parameters
        ----------
        run, starts, steps, executor, progress
            As in :meth:`forecast_windows`.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band
            As in :meth:`forecast_summary`.

        Returns
        -------
        Dataset
            Dimensions (window, statistic, lead); ``diverged`` counts over ``window``.

        Raises
        ------
        RequestError, DataError
            As :meth:`forecast`.
        """
        return ensemble_forecasts.summary_of_windows(
            self, run, starts, steps, level, band, executor, progress
        )

    def save(self, path: str | Path) -> Path:
        """Write draws and training arrays as NetCDF, to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File, overwritten if it exists.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_model` reads it, running no code from it.
        """
        return store.write(self.to_dataset(), path, ensemble_store.BAYESIAN_HANKEL_DMDC)

    def to_dataset(self) -> xr.Dataset:
        """The ensemble as a Dataset: what :meth:`save` writes."""
        return ensemble_store.pack(
            settings=self.settings,
            origin=self.origin,
            members=self.members,
            arrays=self.arrays,
            dt=self.dt,
            labels={"state": self.state_labels, "input": self.input_labels},
            alignment=self.alignment,
            radii=self.radii,
        ).assign_attrs(
            {} if self.calibration is None else {"calibration": self.calibration.to_json()}
        )

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """Rebuild an ensemble from :meth:`to_dataset`.

        Parameters
        ----------
        dataset : Dataset
            What :meth:`save` wrote.

        Returns
        -------
        HankelEnsemble
            Its members are equal to the last bit.
        """
        parts = ensemble_store.unpack(dataset)
        return cls(
            settings=parts.settings,
            origin=parts.origin,
            members=parts.members,
            arrays=parts.arrays,
            dt=parts.dt,
            state_labels=parts.labels["state"],
            input_labels=parts.labels["input"],
            alignment=parts.alignment,
            radii=parts.radii,
            calibration=Calibration.from_json(dataset.attrs.get("calibration", "null")),
        )
