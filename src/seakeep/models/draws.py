r"""Draws of the settings of an ensemble's members.

Every member has a generator of its own, the k-th child of the seed, and reads its numbers from it
alone: a member is the same whatever the number of members, of workers, or the order of work.

Lengths are drawn in encounter periods and become samples by rounding to the nearest integer, halves
upwards (:func:`~seakeep.models.settings.periods_to_samples`). A draw is infeasible where a run that
trains the member does not hold the window with its delay history before it (``history="before"``:
m + max(s, z) samples; ``"inside"``: m samples, and max(s, z) + 2 of them), or an integer is out
of range. All of it is then drawn again from the member's own generator, and counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.errors import DataError
from seakeep.models.settings import periods_to_samples

if TYPE_CHECKING:
    from seakeep.models.ensemble import BayesianHankelDMDc

__all__ = ["Draw", "Sampling", "TrainOn", "draw_members"]

FloatArray = npt.NDArray[np.float64]
Sampling = Literal["monte_carlo", "sobol"]
TrainOn = Literal["all", "runs", "windows"]

MOST_REDRAWS = 1000
"""After so many infeasible draws of one member the priors are taken not to fit the data."""


@dataclass(frozen=True)
class Draw:
    """Settings of one member.

    Parameters
    ----------
    train_length, state_delay, input_delay : float
        Lengths as drawn, encounter periods; the first is NaN where all of a run trains.
    ridge : float
        λ.
    window : int or None
        m, samples.
    state_delays, input_delays : int
        s and z.
    run : int or None
        The run that trains, None for all of them.
    last : int or None
        Last sample of the window in that run, None for the end of what is given.
    redrawn : int
        Infeasible draws before this one.
    """

    train_length: float
    state_delay: float
    input_delay: float
    ridge: float
    window: int | None
    state_delays: int
    input_delays: int
    run: int | None
    last: int | None
    redrawn: int

    def needed(self, inside: bool) -> int:
        """Samples of a run that the window and its history take."""
        reach = max(self.state_delays, self.input_delays)
        least = reach + 2
        if self.window is None:
            return least
        return max(self.window, least) if inside else self.window + reach


def child(seed: np.random.SeedSequence, member: int) -> np.random.Generator:
    """Generator of a member: the child of `seed` with its number, without changing `seed`."""
    key = (*seed.spawn_key, member)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def draw_members(spec: BayesianHankelDMDc, dt: float, samples: Sequence[int]) -> list[Draw]:
    """Draw the settings of all members.

    Parameters
    ----------
    spec : BayesianHankelDMDc
        Priors, seed and rules.
    dt : float
        Time step, s.
    samples : sequence of int
        Samples of each run up to its stop.

    Returns
    -------
    list of Draw
        One a member.

    Raises
    ------
    DataError
        If a member finds no feasible draw in a thousand.
    """
    seed = spec.seed_sequence
    points = np.empty((spec.n_members, 0))
    if spec.sampling == "sobol":
        scrambling = child(seed, spec.n_members)
        engine = scipy.stats.qmc.Sobol(4, scramble=True, rng=scrambling)
        # A power of two, the balance of which the net keeps; the first n_members are used.
        points = engine.random_base2(max(spec.n_members - 1, 1).bit_length())
    return [
        _draw_member(spec, dt, samples, child(seed, member), points[member])
        for member in range(spec.n_members)
    ]


def _draw_member(
    spec: BayesianHankelDMDc,
    dt: float,
    samples: Sequence[int],
    generator: np.random.Generator,
    point: FloatArray,
) -> Draw:
    inside = spec.history == "inside"
    for redrawn in range(MOST_REDRAWS):
        quantiles = point if point.size and not redrawn else generator.random(4)
        draw = _values(spec, dt, quantiles, redrawn)
        if draw.state_delays < 0 or draw.input_delays < 0 or draw.ridge < 0:
            continue
        if draw.window is not None and draw.window < 2:
            continue
        needed = draw.needed(inside)
        if inside and draw.window is not None and draw.window < needed:
            continue
        if spec.train_on == "all":
            if min(samples) >= needed:
                return draw
            continue
        run = int(generator.integers(len(samples)))
        if samples[run] < needed:
            continue
        last = samples[run] - 1
        if spec.train_on == "windows":
            last = int(generator.integers(needed - 1, samples[run]))
        return Draw(**{**draw.__dict__, "run": run, "last": last})
    raise DataError(
        f"no feasible draw in {MOST_REDRAWS}: the shortest run has {min(samples)} samples up to "
        f"stop, and the last draw asked for {needed} (window {draw.window}, delays "
        f"{draw.state_delays} and {draw.input_delays}). Give longer runs or a later stop, or "
        "narrow the priors."
    )


def _values(spec: BayesianHankelDMDc, dt: float, quantiles: FloatArray, redrawn: int) -> Draw:
    length, state, control = (
        float(prior.ppf(float(q))) if prior is not None else np.nan
        for prior, q in zip(
            (spec.train_length, spec.state_delay, spec.input_delay), quantiles[:3], strict=True
        )
    )

    def to_samples(periods: float) -> int:
        return periods_to_samples(periods, spec.encounter_period, dt)

    return Draw(
        train_length=length,
        state_delay=state,
        input_delay=control,
        ridge=float(spec.ridge.ppf(float(quantiles[3]))),
        window=None if spec.train_length is None else to_samples(length),
        state_delays=to_samples(state),
        input_delays=to_samples(control),
        run=None,
        last=None,
        redrawn=redrawn,
    )
