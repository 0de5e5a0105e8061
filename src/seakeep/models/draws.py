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

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import scipy
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.core.embedding import History
from seakeep.errors import DataError, quiet
from seakeep.models.inputs import InputMap
from seakeep.models.priors import unit_of
from seakeep.models.settings import HankelSettings

Sampling = Literal["monte_carlo", "sobol"]
TrainOn = Literal["all", "runs", "windows", "auto"]

PRIORS = ("window", "state_delays", "input_delays", "ridge")
"""Settings that are drawn, in the order of a member's numbers."""
DRAWN = {
    "window": "length of the training window",
    "state_delays": "longest delay of the states",
    "input_delays": "longest delay of the inputs",
}
MOST_REDRAWS = 1000
"""After so many infeasible draws of one member the priors are taken not to fit the data."""


@dataclass(frozen=True)
class Draw:
    """A member: its settings, and what trains it.

    Parameters
    ----------
    settings : HankelSettings
        As of a :class:`HankelDMDc`, in samples.
    drawn : tuple of float
        Window and delays of states and inputs as drawn, in the units of their priors; the first is
        NaN where all of a run trains.
    run : int or None
        The run that trains, None for all of them.
    last : int or None
        Last sample of the window in that run, None for the end of what is given.
    redrawn : int
        Infeasible draws before this one.
    """

    settings: HankelSettings
    drawn: tuple[float, float, float]
    run: int | None = None
    last: int | None = None
    redrawn: int = 0

    def needed(self, input_map: InputMap) -> int:
        """Samples of a run that the window, its history and its look-ahead take."""
        settings = self.settings
        reach = settings.reach(input_map)
        least = reach + 2 + input_map.around.after
        if settings.window is None:
            return least
        inside = settings.history == "inside"
        return max(settings.window, least) if inside else settings.window + reach

    def first(self, run: int, samples: int, input_map: InputMap) -> int:
        """Earliest of the samples of a run that the member reads; their number if it reads none."""
        if self.run not in (None, run):
            return samples
        end = samples if self.last is None else self.last + 1
        return 0 if self.settings.window is None else end - self.needed(input_map)


def child(seed: np.random.SeedSequence, member: int) -> np.random.Generator:
    """Generator of a member: the child of `seed` with its number, without changing `seed`."""
    key = (*seed.spawn_key, member)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def draw_members(spec: Any, dt: float, samples: Sequence[int], input_map: InputMap) -> list[Draw]:
    """Draw the settings of all members.

    Parameters
    ----------
    spec : BayesianHankelDMDc
        Priors, seed and rules; imports of its room run the other way.
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
    seed, shared = spec.seed_sequence, spec.shared(dt)
    points = np.empty((spec.n_members, 0))
    if spec.sampling == "sobol":
        scrambling = np.random.default_rng(seed)
        engine = scipy.stats.qmc.Sobol(len(PRIORS), scramble=True, rng=scrambling)
        # A power of two, the balance of which the net keeps; the first n_members are used.
        points = engine.random_base2(max(spec.n_members - 1, 1).bit_length())
    return [
        _draw_member(spec, shared, dt, samples, input_map, child(seed, number), points[number])
        for number in range(spec.n_members)
    ]


def _draw_member(
    spec: Any,
    shared: HankelSettings,
    dt: float,
    samples: Sequence[int],
    input_map: InputMap,
    generator: np.random.Generator,
    point: FloatArray,
) -> Draw:
    refused = ""
    for redrawn in range(MOST_REDRAWS):
        quantiles = point if point.size and not redrawn else generator.random(len(PRIORS))
        values = [spec.at(name, float(q)) for name, q in zip(PRIORS, quantiles, strict=True)]
        drawn = {name: x for name, x in zip(PRIORS, values, strict=True) if x is not None}
        if wrong := [f"{name} = {x}" for name, x in drawn.items() if not np.isfinite(x)]:
            refused = (
                f"the last one gave {wrong[0]}. Check the parameters of that prior, or give it "
                "bounds."
            )
            continue
        own: dict[str, Any] = {
            name: x if name == "ridge" else spec.samples(name, x, dt) for name, x in drawn.items()
        }
        if refused := _out_of_range(own, shared.history):
            continue
        with quiet():  # given when the priors were made
            settings = replace(shared, **own)
        lengths = drawn.get("window", np.nan), drawn["state_delays"], drawn["input_delays"]
        draw = Draw(settings, lengths, redrawn=redrawn)
        needed = draw.needed(input_map)
        run = None if spec.train_on == "all" else int(generator.integers(len(samples)))
        if (min(samples) if run is None else samples[run]) < needed:
            refused = (
                f"the shortest run has {min(samples)} samples up to stop, and the last draw asked "
                f"for {needed} (window {settings.window}, delays {settings.state_delays} and "
                f"{settings.input_delays}). Give longer runs or a later stop, or narrow the priors."
            )
            continue
        if run is None:
            return draw
        last = samples[run] - 1
        if spec.train_on == "windows":
            last = int(generator.integers(needed - 1, samples[run]))
        return replace(draw, run=run, last=last)
    raise DataError(f"no feasible draw in {MOST_REDRAWS}: {refused}")


def _out_of_range(own: dict[str, Any], history: History) -> str:
    """What is wrong with a draw for any runs; empty where nothing is."""
    s, z = own["state_delays"], own["input_delays"]
    for name in PRIORS[1:]:
        if own[name] < 0:
            return (
                f"the last one gave {name} = {own[name]:.6g}, which is negative. Move the prior "
                "above zero."
            )
    inside = history == "inside"
    least = max(s, z) + 2 if inside else 2
    if "window" in own and own["window"] < least:
        within = f" with delays of {s} and {z} inside it" if inside else ""
        return (
            f"the last one gave a window of {own['window']} samples{within}, and {least} are "
            "needed. Raise window, or lower the delays."
        )
    return ""


INTEGERS = {
    "window_samples": "length of the training window; −1 for all of a run",
    "state_delays_samples": "number of delayed copies of the states",
    "input_delays_samples": "number of delayed copies of the inputs",
    "training_run": "run that trains; −1 for all",
    "last_sample": "last sample of the training window; −1 for that at stop",
    "redrawn": "infeasible draws before this one",
}


def draws_dataset(members: Sequence[Draw], origin: Mapping[str, Any]) -> xr.Dataset:
    """Draws over ``member``; see ``HankelEnsemble.draws``."""
    drawn = np.array([draw.drawn for draw in members], dtype=float)
    variables: dict[str, Any] = {
        name: ("member", values, {"long_name": label, "units": unit_of(origin[name])})
        for (name, label), values in zip(DRAWN.items(), drawn.T, strict=True)
    }
    ridge = np.array([draw.settings.ridge for draw in members], dtype=float)
    variables["ridge"] = ("member", ridge, {"long_name": "ridge λ", "units": "1"})
    rows = [
        (each.window, each.state_delays, each.input_delays, draw.run, draw.last, draw.redrawn)
        for draw in members
        for each in (draw.settings,)
    ]
    for (name, label), column in zip(INTEGERS.items(), zip(*rows, strict=True), strict=True):
        values = np.array([-1 if each is None else each for each in column], dtype=np.int64)
        variables[name] = ("member", values, {"long_name": label, "units": "1"})
    attrs = {
        "ensemble": json.dumps(dict(origin)),
        "redrawn": sum(draw.redrawn for draw in members),
    }
    return xr.Dataset(variables, coords={"member": np.arange(len(members))}, attrs=attrs)


def draws_of(dataset: xr.Dataset, shared: HankelSettings) -> tuple[Draw, ...]:
    """Rebuild draws from :func:`draws_dataset` and what all members share."""
    columns = (dataset[name].values.tolist() for name in ("ridge", *INTEGERS))
    rows = zip(*columns, strict=True)
    drawn = zip(*(dataset[name].values.tolist() for name in DRAWN), strict=True)
    members = []
    with quiet():  # given when the priors were made
        for lengths, (ridge, window, s, z, run, last, redrawn) in zip(drawn, rows, strict=True):
            length, number, end = (None if each < 0 else each for each in (window, run, last))
            settings = replace(shared, ridge=ridge, window=length, state_delays=s, input_delays=z)
            members.append(Draw(settings, lengths, number, end, redrawn))
    return tuple(members)
