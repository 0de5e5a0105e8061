"""Slow motions of which a training window holds too few cycles to estimate mean and spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from seakeep.core.bands import split_bands
from seakeep.errors import warn
from seakeep.models import labelled

FEWEST = 5
"""Slow periods below which the moments of a training window are those of single cycles (row 23 of
what the paper leaves open)."""
SPLIT = 3.0
"""Encounter periods that part slow motions from waves, as in the bands of a study."""
GOVERNS = 0.5
"""Part of a channel's variance from which its slow motion sets mean and standard deviation."""


@dataclass(frozen=True)
class SlowMotion:
    """Slow motion of a channel, and how much of it training holds.

    Parameters
    ----------
    channel : str
        The state.
    period : float
        Mean period between crossings of its mean, s; infinite where it crosses at most once.
    share : float
        Fraction of the channel's variance that is slow, 0 to 1.
    cycles : float
        Periods that the training windows hold in all.
    """

    channel: str
    period: float
    share: float
    cycles: float


def slow_motions(
    runs: Mapping[str, xr.Dataset], states: Sequence[str], trained: float, encounter_period: float
) -> list[SlowMotion]:
    """Find the states that a slow motion governs, and its period.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Training data, all that there is up to where training ends: a slow period is seen better
        in it than in a short window.
    states : sequence of str
        Channels of the model.
    trained : float
        Length of the training windows, summed over the runs, s.
    encounter_period : float
        Mean encounter period, s; what is slower than three of them is slow.

    Returns
    -------
    list of SlowMotion
        States more than half of whose variance is slow, the one with the fewest cycles first.
        Runs with gaps in a state, and runs shorter than six encounter periods, are left
        out.
    """
    shortest = 2 * SPLIT * encounter_period
    out = []
    for state in states:
        crossings, seconds, slow, whole = 0, 0.0, 0.0, 0.0
        for name, run in runs.items():
            dt = labelled.run_step(run, name)
            values = labelled.channel_matrix(run, [state], name)
            if not np.all(np.isfinite(values)) or len(values) * dt < shortest:
                continue
            low = split_bands(values, dt, 1.0 / (SPLIT * encounter_period))[0][:, 0]
            crossings += int(np.sum(np.diff(np.sign(low - low.mean())) != 0))
            seconds += len(values) * dt
            slow += float(np.sum((low - low.mean()) ** 2))
            whole += float(np.sum((values - values.mean()) ** 2))
        if not whole > 0 or slow <= GOVERNS * whole:
            continue
        period = 2.0 * seconds / crossings if crossings > 1 else np.inf
        out.append(SlowMotion(state, float(period), slow / whole, trained / period))
    return sorted(out, key=lambda each: each.cycles)


def warn_of_slow_motions(
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    trained: float,
    encounter_period: float,
    what: str = "the training windows",
) -> None:
    """Warn where training holds fewer than five periods of a slow motion.

    Parameters
    ----------
    runs, states, trained, encounter_period
        As for :func:`slow_motions`.
    what : str, optional
        What the message calls the training windows.

    Warns
    -----
    SeakeepWarning
        One for all states.
    """
    few = [
        each
        for each in slow_motions(runs, states, trained, encounter_period)
        if each.cycles < FEWEST
    ]
    if not few:
        return
    worst = few[0]
    others = ", ".join(each.channel for each in few[1:])
    length = "longer than the record" if np.isinf(worst.period) else f"{worst.period:.3g} s"
    warn(
        f"{what}, {trained:.4g} s in all, hold {worst.cycles:.1f} periods of the slow motion of "
        f"{worst.channel} (period {length}, {100 * worst.share:.0f} % of its variance), fewer than "
        f"{FEWEST}{f'; the same holds for {others}' if others else ''}. Means and standard "
        "deviations are then those of single cycles. Lengthen the window, or train on more runs."
    )
