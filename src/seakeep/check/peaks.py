r"""Statistics of responses, as designers read them: measured against forecast.

Weibull's law of peaks is :math:`P(a > x) = \exp(-(x/b)^k)`; Rayleigh's is that with k = 2 and
:math:`b = \sqrt 2\,\sigma`. Of N peaks the most probable largest is
:math:`b\,(\ln N)^{1/k}` (Ochi, 1990, section 4), and the chance that the largest is x or more is
:math:`1 - (1 - P(a > x))^N`.
"""

from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import optimize, stats

from seakeep.arrays import TINY, Datasets, FloatArray
from seakeep.check.parts import Known, deviations, free_runs, irregular, judged, units_of
from seakeep.conventions import is_load
from seakeep.core.density import jensen_shannon, kernel_density
from seakeep.errors import SeakeepError
from seakeep.models import Model
from seakeep.signals import zero_up_crossings

BAND = 2.0
"""SDs of noise on either side of the mean that a record passes at a crossing."""
HOURS = 3.0
KINDS = ("measured", "forecast")
PLACES = 161
EXTREME = ("extreme", "extreme_lower", "extreme_upper", "extreme_chance")


def statistics(
    model: Model, runs: Datasets, duration: float | None = None, free: Known | None = None
) -> xr.Dataset:
    r"""Peaks of each state over the test parts in irregular waves, measured and forecast.

    A peak is the largest deviation above the mean of its run between two zero-up-crossings. One
    counts where the record goes from below to above the mean by two SDs of the sensor's noise,
    ``attrs["noise_std"]`` of the channel.

    Parameters
    ----------
    model : Model
        The model.
    runs : mapping of str to Dataset
        Prepared runs; tests in irregular waves are taken, or what trains where no run tests.
    duration : float, optional
        Time of the extreme, s; by default three hours at full scale, by Froude's law with
        ``attrs["scale_factor"]``.
    free : dict, optional
        Free runs that other checks of the same model and runs made; this one adds its own.

    Returns
    -------
    Dataset
        Over (state, kind), kind "measured" or "forecast": ``mean``,
        ``significant_double_amplitude`` (four SDs), ``zero_crossing_period`` (s), ``peaks`` (how
        many), ``rayleigh_scale`` (the SD), ``weibull_shape`` and ``weibull_scale`` (maximum
        likelihood), ``extreme`` (most probable in the duration by Weibull's law) with
        ``extreme_lower`` and ``extreme_upper`` (95 %, what the fit does not know),
        ``extreme_chance``, by that law, that the largest of so many peaks is as large as the
        largest here, and the same of troughs, ``trough``…: NaN of loads in N, which count upward;
        over (state, kind, rank): ``peak`` and ``exceedance``, largest first; over (state, kind,
        place):
        ``density`` of the deviations at ``deviation`` over (state, place); over state:
        ``divergence`` (Jensen–Shannon) of the two densities, NaN where one stands still.
        ``attrs["duration"]`` (s).

    Raises
    ------
    DataError
        If no run in irregular waves can be forecast.
    """
    runs, of = judged(runs)
    waves = irregular(runs, "a statistic of peaks")
    known = free_runs(model, waves, free)
    if duration is None:
        facts = next(iter(waves.values())).attrs
        scale = 1.0 if facts.get("scale") == "full" else facts.get("scale_factor", 1.0)
        duration = 3600 * HOURS / np.sqrt(scale)
    moved = {kind: deviations(known, kind) for kind in KINDS}
    parts, units = [], units_of(model, model.states)
    for column, state in enumerate(model.states):
        noise = [waves[name][state].attrs.get("noise_std", 0.0) for name in known]
        laws, known_below = [], np.nan if is_load(units[column]) else 1.0
        for of_kind in moved.values():
            above, below = (
                _law([side * x[:, column] for x in of_kind], noise, model.dt, duration)
                for side in (1, -1)
            )
            troughs = {k.replace("extreme", "trough"): known_below * below[k] for k in EXTREME}
            laws.append(above.assign(troughs))
        parts.append(xr.concat(laws, xr.Variable("kind", list(moved)), join="outer"))
    names = xr.Variable("state", model.states)
    out = xr.concat(parts, names, join="outer").drop_vars("rank").transpose("state", ...)
    deviation, density = _densities(np.array([np.concatenate(each) for each in moved.values()]))
    means = [np.concatenate([getattr(x, k) for x in known.values()]).mean(axis=0) for k in KINDS]
    out["mean"] = (("kind", "state"), means)
    out["deviation"] = (("state", "place"), deviation)
    out["density"] = (("state", "kind", "place"), density)
    divergence = [jensen_shannon(*x) if np.isfinite(x).all() else np.nan for x in density]
    out["divergence"] = ("state", divergence)
    return out.assign_coords(units=("state", units)).assign_attrs(duration=duration, of=of)


def _densities(both: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Densities of deviations (kind, time, state) on a grid for each state."""
    both = both[:, np.isfinite(both).all(axis=(0, 2))]  # a free run that was lost
    reach = 1.1 * np.abs(both).max(axis=(0, 1), initial=0.0)
    reach[reach == 0] = 1.0
    grids = np.linspace(-reach, reach, PLACES, axis=-1)
    densities = np.full((len(grids), len(KINDS), PLACES), np.nan)
    for state, side in np.ndindex(densities.shape[:2]):
        values = both[side, :, state]
        if values.size and np.ptp(values) > 0:
            density = kernel_density(values, grids[state])
            if density.sum() * 2 * reach[state] / PLACES > 0.5:  # else the grid is too coarse
                densities[state, side] = density
    return grids, densities


def _law(moved: list[FloatArray], noise: list[float], dt: float, duration: float) -> xr.Dataset:
    """Statistics of the deviations of several records of a state; peaks largest first."""
    every, periods = list[float](), list[float]()
    for x, its_noise in zip(moved, noise, strict=True):
        with suppress(SeakeepError):  # without waves, or lost, a free run has no peaks
            crossings = zero_up_crossings(x, dt, BAND * its_noise / max(x.std(), TINY))
            edges = np.ceil(crossings / dt).astype(int)
            every += [x[a:b].max() for a, b in pairwise(edges) if b > a]
            periods += [*np.diff(crossings)]
    peaks = np.array(every)
    rank = np.arange(1, peaks.size + 1)
    spread = np.sqrt(np.mean(np.concatenate(moved) ** 2))
    period = float(np.mean(periods)) if periods else np.nan
    law = fit_weibull(peaks)
    extreme = most_probable_extreme(law, duration / period)
    above = np.exp(-((peaks.max(initial=0.0) / law.scale) ** law.shape))
    chance = -np.expm1(law.peaks * np.log1p(-above))
    return xr.Dataset(
        {
            "significant_double_amplitude": 4 * spread,
            "zero_crossing_period": period,
            "peaks": float(peaks.size),
            "rayleigh_scale": spread,
            "weibull_shape": law.shape,
            "weibull_scale": law.scale,
            **dict(zip(EXTREME, (*extreme, chance), strict=True)),
            "peak": ("rank", -np.sort(-peaks)),
            "exceedance": ("rank", rank / (peaks.size + 1)),
        },
        {"rank": rank},
    )


FEWEST = 10
"""Peaks from which on a law is fitted."""


class Weibull(NamedTuple):
    """Weibull's law of peaks, fitted by maximum likelihood.

    Attributes
    ----------
    shape, scale : float
        k and b; NaN where there are fewer than ten peaks.
    peaks : int
        How many.
    """

    shape: float
    scale: float
    peaks: int


def fit_weibull(peaks: FloatArray) -> Weibull:
    r"""Fit Weibull's law to positive peaks by maximum likelihood.

    Parameters
    ----------
    peaks : ndarray, shape (peak,)
        Those that are not positive are left out.

    Returns
    -------
    Weibull
        Its shape less the bias of maximum likelihood, :math:`1.38\,k/n` (Cohen and Whitten, 1982).
    """
    x = peaks[peaks > 0]
    if x.size < FEWEST or np.ptp(x) == 0:
        return Weibull(np.nan, np.nan, x.size)
    unit = x / x.max()  # powers stay in range
    logs = np.log(unit)

    def slope(k: float) -> float:
        """Of the likelihood, which has one maximum, divided by the number and turned over."""
        return float(np.average(logs, weights=unit**k) - 1 / k - logs.mean())

    k = optimize.brentq(slope, 1e-4 / logs.std(), 1e4 / logs.std())
    k *= 1 - 1.38 / x.size
    return Weibull(k, float(x.max() * np.mean(unit**k) ** (1 / k)), x.size)


def most_probable_extreme(law: Weibull, peaks: float) -> tuple[float, float, float]:
    r"""Most probable largest of many peaks, with an interval for what the fit does not know.

    Parameters
    ----------
    law : Weibull
        Of peaks that do not depend on each other.
    peaks : float
        How many are expected in the time asked for.

    Returns
    -------
    extreme, lower, upper : float
        By the asymptotic covariance of the estimates: the variance of
        :math:`\ln x` is :math:`(1.109 + 0.608\,g^2 - 0.514\,g)/(n k^2)` with
        :math:`g = \ln\ln N` (Lawless, Statistical Models and Methods for Lifetime Data, 2003,
        section 5.2).
    """
    if not np.isfinite(law.shape) or peaks <= 1:
        return np.nan, np.nan, np.nan
    g = np.log(np.log(peaks))
    extreme = law.scale * np.exp(g / law.shape)
    variance = (1.109 + 0.608 * g**2 - 0.514 * g) / (law.peaks * law.shape**2)
    width = np.exp(stats.t.ppf(0.975, law.peaks - 1) * np.sqrt(variance))
    return float(extreme), float(extreme / width), float(extreme * width)
