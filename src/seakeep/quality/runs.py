"""Runs compared with one another: a probe's unit, sign or gain that only one has, a file of two."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import scipy
import xarray as xr

from seakeep.arrays import ComplexArray, Datasets, FloatArray
from seakeep.conventions import in_waves, is_elevation
from seakeep.quality.findings import (
    Finding,
    Findings,
    Kind,
    as_json,
    filled,
    findings_of,
    step_of,
    warn_of,
)
from seakeep.quality.sensors import LEAST_CORRELATION
from seakeep.signals import zero_up_crossings
from seakeep.signals.waves import is_regular


class RunsKind(Kind):
    """Findings from the comparison of two runs."""

    PROBE = (
        "moves {size:.3g} times as much{turned} beside {other} as in most other runs",
        "Check units, signs and calibrations of both in the files of {run}.",
    )
    FILE = (
        "is one of {other} too, and both use it from {place:.4g} s to {value:.4g}",
        "Correct it in [runs.{run}], or state spans that do not overlap: a test on samples that "
        "trained shows memory, not skill.",
    )


LARGEST_CHANGE = 1.2
"""Factor between the gains of two runs below which nothing is said, on top of three standard
errors: probes are calibrated to 1 or 2 %, and where a tenth of the waves is reflected by a model
that drifts, one frequency changes by 1.1/0.9 at most."""
NODES = 5.0
"""That factor where runs have no frequencies in common, or phases of their own: waves of which two
thirds are reflected are five times as high at antinodes as at nodes."""
FEWEST_WAVES = 40
"""Waves in irregular runs from which on frequencies are compared."""
HYSTERESIS = 0.1
"""Part of a standard deviation that a wave must exceed to be counted, so that noise is not."""
SURELY = 3.0
"""Standard errors by which gains must differ."""
STRONG = 1e-3
"""Part of the strongest frequency's weight below which a frequency is noise."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """What two probes of a run saw: their ratio, waves (0 of regular ones), and spectra."""

    ratio: float
    waves: int
    first: FloatArray
    second: FloatArray
    cross: ComplexArray

    def gain(self, other: _Seen) -> tuple[float, float]:
        """Gain of the second probe over that in another run, and the factor allowed."""
        waves, simple = min(self.waves, other.waves), (self.ratio / other.ratio, NODES)
        if waves < FEWEST_WAVES:
            return simple
        both = self.cross * np.conj(other.cross)
        weight = np.abs(both)
        alike = both.real.sum() / weight.sum()
        if abs(alike) < LEAST_CORRELATION:
            return simple
        strong = weight > STRONG * weight.max()
        powers = (self.second * other.first)[strong] / (self.first * other.second)[strong]
        size = np.exp(0.5 * np.average(np.log(powers), weights=weight[strong]))
        doubt = np.exp(SURELY * np.sqrt((1 - alike**2) / waves))
        return float(np.sign(alike) * size), float(LARGEST_CHANGE * doubt)


def odd_probes(runs: Datasets) -> Findings:
    """Probes that move by another factor beside the first one than in most of the other runs.

    Gains and phases are compared frequency by frequency, so that seas of other periods and waves
    that a model reflects make no difference; in regular waves, standard deviations alone.

    Of 180 made-up campaigns of four sound runs each (noise up to the waves' own size, reflections
    of three tenths from a model that drifts by 1 m, narrow seas, runs of 80 s) none was doubted; of
    90 with a gain of 1.3 or another sign in one run, that run was named in all.
    """
    moving = in_waves(runs)
    every = [run.data_vars for run in moving.values()]
    probes = filter(is_elevation, map(str, every[0] if every else ()))
    first, *others = [name for name in probes if all(name in each for each in every)] or [""]
    odd: dict[str, dict[str, FloatArray]] = {name: {} for name in moving}
    for probe in others:
        seen = _seen(moving, first, probe)
        for name, own in seen.items():
            gains = [own.gain(each) for other, each in seen.items() if other != name]
            beyond = [(g, most) for g, most in gains if g < 0 or max(g, 1 / g) > most]
            if 2 * len(beyond) > len(gains):
                odd[name][probe] = np.median(beyond, axis=0)
    for name, found in odd.items():
        is_first = len(found) == len(others) > 1  # all of them move otherwise beside it
        for probe, (gain, limit) in list(found.items())[: 1 if is_first else None]:
            value = float(1 / gain if is_first else gain)
            channel, other = (first, probe) if is_first else (probe, first)
            yield Finding(
                RunsKind.PROBE, name, channel, value, float(limit),
                details={
                    "other": other,
                    "size": abs(value),
                    "turned": ", and turned over," if value < 0 else "",
                },
            )  # fmt: skip


def shared_files(runs: Datasets) -> Findings:
    """Runs that use the same part of files that have the same content."""
    for (name, first), (other, second) in combinations(runs.items(), 2):
        both = (first.attrs, second.attrs)
        files = [set(each.get("file_sha256", "").split()) for each in both]
        used = [[each[k] for k in ("train_span", "test_span") if k in each] for each in both]
        parts = [(max(a[0], b[0]), min(a[1], b[1])) for a, b in product(*used)]
        shared = [part for part in parts if part[0] < part[1]]
        if shared and files[0] & files[1]:
            begin, end = min(shared)[0], max(part[1] for part in shared)
            yield Finding(RunsKind.FILE, other, "file", end, None, "s", begin, {"other": name})


def judge_runs(runs: Datasets) -> list[str]:
    """Put such findings beside the others of each run, warn of them, and say which runs changed."""
    found, changed = [*odd_probes(runs), *shared_files(runs)], []
    for name, run in runs.items():
        before = findings_of(run)
        others = [each for each in before if not isinstance(each.kind, RunsKind)]
        every = as_json([*others, *(each for each in found if each.run == name)])
        if every != as_json(before):
            run.attrs["quality"] = every
            changed.append(name)
    warn_of(found, set())
    return changed


def _seen(runs: Datasets, first: str, second: str) -> dict[str, _Seen]:
    """What two probes saw in each run in which both move."""
    pairs = {name: [filled(run[each]) for each in (first, second)] for name, run in runs.items()}
    pairs = {name: pair for name, pair in pairs.items() if all(map(np.ptp, pair))}
    waves = {name: _waves(runs[name], *pair) for name, pair in pairs.items()}
    lengths = [pairs[name][0].size // 2 for name in pairs if waves[name] >= FEWEST_WAVES]
    out = {}
    for name, (x, y) in pairs.items():
        how = {"fs": 1 / step_of(runs[name]), "nperseg": min([x.size, *lengths])}
        spectra = (scipy.signal.csd(a, b, **how)[1][1:] for a, b in ((x, x), (y, y), (x, y)))
        out[name] = _Seen(float(y.std() / x.std()), waves[name], *spectra)
    return out


def _waves(run: xr.Dataset, *probes: FloatArray) -> int:
    """Waves that probes counted, the fewest; none in regular waves."""
    if run.attrs.get("waves") == "regular" or any(map(is_regular, probes)):
        return 0
    return min(zero_up_crossings(each, step_of(run), HYSTERESIS).size for each in probes)
