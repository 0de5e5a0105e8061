"""Agreement of two measurements of one motion: the video against the motion reference unit.

Source: the paper's section "Motion measurements", which validates the video by its heave and
pitch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy
import xarray as xr

from seakeep.arrays import FloatArray, positive
from seakeep.conventions import conversion
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.signals.time_axis import check_order

__all__ = ["Agreement", "compare_motion"]


SHORTEST = 16
"""Samples in common below which a correlation says nothing."""
LONGEST = 10.0
"""Lag searched by default, s: clocks set by hand, or recordings started by a shout."""
FINEST = 0.01
"""Difference, in SD of the motion, below which two sensors are taken to agree."""


@dataclass(frozen=True)
class Agreement:
    """How well a channel of one record agrees with the same channel of another.

    Parameters
    ----------
    channel : str
        The channel.
    units : str
        Unit of `rms` and `offset`.
    correlation : float
        Greatest correlation, at `lag`.
    correlation_at_zero : float
        Correlation with no lag.
    lag : float
        s by which the first record is late behind the second; sub-sample.
    rms : float
        Root mean square of the difference at `lag`, means removed.
    offset : float
        Mean of the first record less that of the second.
    samples : int
        Samples compared.
    at_limit : bool
        Whether `lag` is the longest searched, so that the true one may be longer.
    max_lag : float
        Longest lag searched, s.
    period : float
        Mean zero-crossing period of the motion, s.
    rival_lag : float
        Lag of the next highest peak of the correlation, s, commonly a wave period off; NaN where
        the lags searched hold no other.
    rival_correlation : float
        Correlation there; NaN likewise.
    """

    channel: str
    units: str
    correlation: float
    correlation_at_zero: float
    lag: float
    rms: float
    offset: float
    samples: int
    at_limit: bool
    max_lag: float
    period: float
    rival_lag: float
    rival_correlation: float

    @property
    def enclosed(self) -> bool:
        """Whether lags one wave period off `lag` were searched too, on either side."""
        return abs(self.lag) + self.period <= self.max_lag

    @property
    def ambiguous(self) -> bool:
        """Whether at `rival_lag` the difference is less than twice that at `lag`."""
        return _misfit(self.rival_correlation) < 2.0 * max(_misfit(self.correlation), FINEST)


def _misfit(correlation: float) -> float:
    """RMS difference of two series of SD 1."""
    return float(np.sqrt(max(2.0 * (1.0 - correlation), 0.0)))


def compare_motion(
    tracked: xr.Dataset,
    reference: xr.Dataset,
    channels: Iterable[str] = ("heave", "pitch"),
    max_lag: float | None = None,
) -> dict[str, Agreement]:
    """Compare a video's motions with those of a motion reference unit.

    Parameters
    ----------
    tracked : Dataset
        From :func:`seakeep.signals.tracking.track_video`; samples that are NaN are left out.
    reference : Dataset
        The same channels over ``time`` (s), in any unit that its attribute ``units`` states;
        interpolated by cubics, so its step should resolve the motion.
    channels : iterable of str, optional
        Channels.
    max_lag : float, optional
        Longest lag searched, s; by default 10 s, or a quarter of the shorter record. In regular
        waves a lag is known only up to a whole period, which `Agreement.ambiguous` tells.

    Returns
    -------
    dict of str to Agreement

    Raises
    ------
    RequestError
        If a channel is missing.
    DataError
        If the records have too few samples in common, or a channel is constant.

    Examples
    --------
    >>> t = np.arange(0, 30, 0.02)
    >>> def record(late):
    ...     heave = ("time", np.sin(4 * (t - late)), {"units": "m"})
    ...     return xr.Dataset({"heave": heave}, {"time": t})
    >>> found = compare_motion(record(0.1), record(0.0), ["heave"], max_lag=0.5)["heave"]
    >>> round(found.lag, 3), round(found.correlation, 3)
    (0.1, 1.0)
    """
    if max_lag is not None:
        positive(max_lag, "max_lag", "s")
    names = list(channels)
    for name in names:
        for which, data in (("tracked", tracked), ("reference", reference)):
            if name not in data:
                raise RequestError(
                    f"the {which} record has no channel '{name}'."
                    f"{did_you_mean(name, map(str, data.data_vars))} It holds "
                    f"{', '.join(map(str, data.data_vars))}."
                )
    return {name: _compare(tracked[name], reference[name], max_lag) for name in names}


def _compare(first: xr.DataArray, second: xr.DataArray, reach: float | None) -> Agreement:
    name = str(first.name)
    unit = str(first.attrs.get("units", "1"))
    factor = conversion(str(second.attrs.get("units", unit)), unit, f"'{name}'")
    t1, y1 = _finite(first, f"tracked '{name}'")
    t2, y2 = _finite(second, f"reference '{name}'")
    max_lag = reach or min(LONGEST, 0.25 * float(min(np.ptp(t1), np.ptp(t2))))
    # Only instants whose partner lies inside the other record at every lag searched.
    common = (t1 >= t2[0] + max_lag) & (t1 <= t2[-1] - max_lag)
    t1, y1 = t1[common], y1[common]
    if t1.size < SHORTEST:
        raise DataError(
            f"'{name}': the records have {t1.size} samples in common once lags of up to "
            f"{max_lag:g} s are allowed for, fewer than {SHORTEST}. Bring them onto one clock, or "
            "search shorter lags."
        )
    spline = scipy.interpolate.CubicSpline(t2, factor * y2)
    if np.ptp(y1) == 0 or np.ptp(y2) == 0:
        which = "tracked" if np.ptp(y1) == 0 else "reference"
        raise DataError(f"the {which} '{name}' is constant: nothing to compare. Check the sensor.")

    def correlation(lag: float) -> float:
        return float(np.corrcoef(y1, spline(t1 - lag))[0, 1])

    step = min(float(np.median(np.diff(t1))), float(np.median(np.diff(t2))))
    lags = np.linspace(-max_lag, max_lag, 2 * int(np.ceil(max_lag / step)) + 1)
    values = np.array([correlation(lag) for lag in lags])
    best = int(np.argmax(values))
    lag = float(lags[best])
    at_limit = best in (0, lags.size - 1)
    if not at_limit:
        lag = float(
            scipy.optimize.minimize_scalar(
                lambda shift: -correlation(shift),
                bounds=(lags[best - 1], lags[best + 1]),
                method="bounded",
                options={"xatol": 1e-4 * step},
            ).x
        )
    inner = values[1:-1]
    peaks = 1 + np.flatnonzero((inner > values[:-2]) & (inner >= values[2:]))
    others = peaks[np.abs(peaks - best) > 1]
    rival = int(others[np.argmax(values[others])]) if others.size else None
    crossings = int(np.count_nonzero(np.diff(y1 > np.mean(y1))))
    difference = y1 - spline(t1 - lag)
    return Agreement(
        channel=name,
        units=unit,
        correlation=correlation(lag),
        correlation_at_zero=correlation(0.0),
        lag=lag,
        rms=float(np.std(difference)),
        offset=float(np.mean(difference)),
        samples=int(t1.size),
        at_limit=at_limit,
        max_lag=max_lag,
        period=2.0 * float(t1[-1] - t1[0]) / max(crossings, 1),
        rival_lag=np.nan if rival is None else float(lags[rival]),
        rival_correlation=np.nan if rival is None else float(values[rival]),
    )


def _finite(series: xr.DataArray, name: str) -> tuple[FloatArray, FloatArray]:
    time = series["time"].to_numpy().astype(float)
    values = series.to_numpy().astype(float)
    there = np.isfinite(values)
    return check_order(time[there], name), values[there]
