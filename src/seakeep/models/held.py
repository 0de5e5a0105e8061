"""An ensemble whose members are held ready: a band within a tick of the clock."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError
from seakeep.models.calibration import Band, check_band, warn_of_horizon, widened
from seakeep.models.executor import Progress, in_order, one_blas_thread
from seakeep.models.forecasting import check_arrays
from seakeep.models.members import Member, TrainingArrays, identify_member
from seakeep.models.settings import HankelSettings
from seakeep.models.summaries import check_level, first_lost, statistics_of
from seakeep.models.windows import free_runs

if TYPE_CHECKING:
    from seakeep.models.draws import Draw
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = ["BandForecast", "HeldEnsemble", "hold"]

FloatArray = npt.NDArray[np.float64]


class BandForecast(NamedTuple):
    """Forecast of an ensemble as plain arrays, physical units.

    Attributes
    ----------
    mean, std, lower, upper : ndarray, shape (steps, N)
        Mean, standard deviation and bounds over the members, at k + 1 … k + steps.
    diverged : int
        Members that diverged and are left out of all four.
    """

    mean: FloatArray
    std: FloatArray
    lower: FloatArray
    upper: FloatArray
    diverged: int


@dataclass(frozen=True, eq=False)
class HeldEnsemble:
    """Members with their matrices, for forecasts in a loop or on board.

    Made by :meth:`HankelEnsemble.hold`. A :class:`~seakeep.models.HankelEnsemble` identifies its
    members anew in each call and so needs little memory; here each is identified once.

    Parameters
    ----------
    ensemble : HankelEnsemble
        Where the members come from.
    members : tuple of Member
        All of them, identified.
    """

    ensemble: HankelEnsemble
    members: tuple[Member, ...]

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(n_members={len(self.members)}, states={self.ensemble.states}, "
            f"inputs={self.ensemble.inputs}, dt={self.ensemble.dt:g}, "
            f"{self.nbytes / 2**20:.0f} MiB)"
        )

    @property
    def nbytes(self) -> int:
        """Bytes of the members' coefficients."""
        return sum(member.coefficients.nbytes for member in self.members)

    def forecast_arrays(
        self,
        x_history: npt.ArrayLike,
        u_history: npt.ArrayLike,
        u_future: npt.ArrayLike,
        steps: int,
        level: float = 0.95,
        *,
        band: Band = "members",
    ) -> BandForecast:
        """Free runs of all members from arrays, reduced to mean and band.

        Parameters
        ----------
        x_history : array_like, shape (at least s + 1, N)
            States up to and including instant k, oldest first, physical units, in the order of
            ``ensemble.states``; s is the longest of a member (``ensemble.state_delays``).
        u_history : array_like, shape (at least z + 1, Q)
            Inputs up to and including instant k, in the order of ``ensemble.inputs``, aligned
            already if the ensemble aligns them; z likewise.
        u_future : array_like, shape (at least steps − 1, Q)
            Inputs at k + 1, k + 2, …; shape (0, 0) for members without input.
        steps : int
            Number of instants.
        level : float, optional
            Probability between ``lower`` and ``upper``.
        band : {"members", "calibrated"}, optional
            As in :meth:`HankelEnsemble.forecast_summary`.

        Returns
        -------
        BandForecast
            The numbers of :meth:`HankelEnsemble.forecast_summary`.

        Raises
        ------
        RequestError
            If a shape or name does not fit, or there is no such band.
        """
        ensemble = self.ensemble
        level = check_level(level)
        check_band(ensemble, level, band)
        x, u = check_arrays(ensemble, x_history, u_history, u_future, steps)
        if band == "calibrated":
            warn_of_horizon(ensemble, "these arrays", int(steps), stacklevel=3)
        out = np.empty((len(self.members), int(steps), x.shape[1]))
        with one_blas_thread():
            for series, member in zip(out, self.members, strict=True):
                series[:] = free_runs(member, x[None], u[None], int(steps))[0]
        kept = out[first_lost(out) < 0]
        mean, std, lower, upper = widened(ensemble, statistics_of(kept, level), band)
        return BandForecast(mean, std, lower, upper, len(out) - len(kept))


def hold(
    ensemble: HankelEnsemble, executor: Executor | None, progress: Progress | None
) -> HeldEnsemble:
    """Identify all members; see :meth:`HankelEnsemble.hold`."""
    alignment = ensemble.alignment
    if alignment is not None and alignment.settings.surge == "predicted":
        raise RequestError(
            "the ensemble carries the waves to the surge that its members predict, which plain "
            "arrays have no places of probes for. Use forecast_summary, or fit with an alignment "
            "of surge='none'."
        )
    data = (ensemble.arrays, ensemble.settings)
    return HeldEnsemble(
        ensemble, tuple(in_order(_identify, data, ensemble.members, executor, progress))
    )


def _identify(data: tuple[TrainingArrays, HankelSettings], draw: Draw) -> Member:
    return identify_member(*data, draw)
