r"""Draws of the settings of an ensemble's members.

Every member has a generator of its own, the k-th child of the seed, and reads its numbers from it
alone, or from the k-th point of a Sobol net that the seed itself scrambles: a member is the same
for any number of members or workers, in any order of work.

Lengths are drawn in the unit of their prior and become samples by rounding to the nearest integer,
halves upwards (:func:`~seakeep.models.settings.in_samples`). A draw is infeasible where a run that
trains the member does not hold the window with its delay history before it (``history="before"``:
m + max(s, z) samples; ``"inside"``: m samples, and max(s, z) + 2 of them), an integer is out of
range, or a quantile is not finite. All of it is then drawn again from the member's own generator,
and counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
import scipy

from seakeep.arrays import FloatArray
from seakeep.errors import DataError
from seakeep.models.inputs import InputMap
from seakeep.models.settings import History

__all__ = ["Draw", "Sampling", "TrainOn", "draw_members"]

Sampling = Literal["monte_carlo", "sobol"]
TrainOn = Literal["all", "runs", "windows", "auto"]

PRIORS = ("window", "state_delays", "input_delays", "ridge")
"""Settings that are drawn, in the order of a member's numbers."""
MOST_REDRAWS = 1000
"""After so many infeasible draws of one member the priors are taken not to fit the data."""


@dataclass(frozen=True)
class Draw:
    """Settings of one member.

    Parameters
    ----------
    drawn : tuple of float
        Window and delays of states and inputs as drawn, in the units of their priors; the first is
        NaN where all of a run trains.
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

    drawn: tuple[float, float, float]
    ridge: float
    window: int | None
    state_delays: int
    input_delays: int
    run: int | None
    last: int | None
    redrawn: int

    def needed(self, inside: bool, history: int = 0, lead: int = 0) -> int:
        """Samples of a run that the window, its history and its look-ahead take.

        `history` is what the input map reads before an instant, and `lead` what it reads after.
        """
        reach = max(self.state_delays, self.input_delays, history)
        least = reach + 2 + max(lead - 1, 0)
        if self.window is None:
            return least
        return max(self.window, least) if inside else self.window + reach


class Drawn(Protocol):
    """Priors, seed and rules that make the draws; see :class:`seakeep.BayesianHankelDMDc`."""

    @property
    def n_members(self) -> int: ...
    @property
    def sampling(self) -> Sampling: ...
    @property
    def train_on(self) -> TrainOn: ...
    @property
    def history(self) -> History: ...
    @property
    def seed_sequence(self) -> np.random.SeedSequence: ...
    def at(self, name: str, q: float) -> float | None: ...
    def samples(self, name: str, value: float, dt: float) -> int: ...


def child(seed: np.random.SeedSequence, member: int) -> np.random.Generator:
    """Generator of a member: the child of `seed` with its number, without changing `seed`."""
    key = (*seed.spawn_key, member)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def draw_members(spec: Drawn, dt: float, samples: Sequence[int], input_map: InputMap) -> list[Draw]:
    """Draw the settings of all members.

    Parameters
    ----------
    spec : BayesianHankelDMDc
        Priors, seed and rules.
    dt : float
        Time step, s.
    samples : sequence of int
        Samples of each run up to its stop.
    input_map : InputMap
        Says what history and look-ahead it takes.

    Returns
    -------
    list of Draw
        One per member.

    Raises
    ------
    DataError
        If a member finds no feasible draw in a thousand.
    """
    seed = spec.seed_sequence
    points = np.empty((spec.n_members, 0))
    if spec.sampling == "sobol":
        scrambling = np.random.default_rng(seed)
        engine = scipy.stats.qmc.Sobol(4, scramble=True, rng=scrambling)
        # A power of two, the balance of which the net keeps; the first n_members are used.
        points = engine.random_base2(max(spec.n_members - 1, 1).bit_length())
    return [
        _draw_member(spec, dt, samples, input_map, child(seed, member), points[member])
        for member in range(spec.n_members)
    ]


def _draw_member(
    spec: Drawn,
    dt: float,
    samples: Sequence[int],
    input_map: InputMap,
    generator: np.random.Generator,
    point: FloatArray,
) -> Draw:
    inside = spec.history == "inside"
    refused = ""
    for redrawn in range(MOST_REDRAWS):
        quantiles = point if point.size and not redrawn else generator.random(4)
        drawn = _quantiles_of(spec, quantiles)
        if refused := _not_finite(drawn):
            continue
        draw = _rounded(spec, dt, drawn, redrawn)
        if refused := _out_of_range(draw, inside):
            continue
        needed = draw.needed(inside, input_map.history(draw.input_delays), input_map.lead_samples)
        run = None if spec.train_on == "all" else int(generator.integers(len(samples)))
        if (min(samples) if run is None else samples[run]) < needed:
            refused = (
                f"the shortest run has {min(samples)} samples up to stop, and the last draw asked "
                f"for {needed} (window {draw.window}, delays {draw.state_delays} and "
                f"{draw.input_delays}). Give longer runs or a later stop, or narrow the priors."
            )
            continue
        if run is None:
            return draw
        last = samples[run] - 1
        if spec.train_on == "windows":
            last = int(generator.integers(needed - 1, samples[run]))
        return replace(draw, run=run, last=last)
    raise DataError(f"no feasible draw in {MOST_REDRAWS}: {refused}")


def _quantiles_of(spec: Drawn, quantiles: FloatArray) -> dict[str, float]:
    found = {name: spec.at(name, float(q)) for name, q in zip(PRIORS, quantiles, strict=True)}
    return {name: value for name, value in found.items() if value is not None}


def _not_finite(drawn: dict[str, float]) -> str:
    """What is wrong with quantiles that cannot be rounded; empty where nothing is."""
    wrong = [f"{name} = {value}" for name, value in drawn.items() if not np.isfinite(value)]
    if not wrong:
        return ""
    return f"the last one gave {wrong[0]}. Check the parameters of that prior, or give it bounds."


def _out_of_range(draw: Draw, inside: bool) -> str:
    """What is wrong with a draw for any runs; empty where nothing is."""
    for name in ("state_delays", "input_delays", "ridge"):
        if (value := getattr(draw, name)) < 0:
            return (
                f"the last one gave {name} = {value:.6g}, which is negative. Move the prior above "
                "zero."
            )
    least = draw.needed(inside) if inside else 2
    if draw.window is not None and draw.window < least:
        within = (
            f" with delays of {draw.state_delays} and {draw.input_delays} inside it"
            if inside
            else ""
        )
        return (
            f"the last one gave a window of {draw.window} samples{within}, and {least} are "
            "needed. Raise window, or lower the delays."
        )
    return ""


def _rounded(spec: Drawn, dt: float, drawn: dict[str, float], redrawn: int) -> Draw:
    lengths = {name: spec.samples(name, drawn[name], dt) for name in PRIORS[:3] if name in drawn}
    return Draw(
        drawn=(drawn.get("window", np.nan), drawn["state_delays"], drawn["input_delays"]),
        ridge=drawn["ridge"],
        window=lengths.get("window"),
        state_delays=lengths["state_delays"],
        input_delays=lengths["input_delays"],
        run=None,
        last=None,
        redrawn=redrawn,
    )
