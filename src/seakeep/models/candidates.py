"""What a search tries: settings that differ from the best so far in one respect."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.alignment import LEAD, FittedAlignment, ProbeAlignment
from seakeep.models.labelled import TrainingRuns
from seakeep.models.observables import Powers, SlowSquares
from seakeep.models.settings import HankelSettings
from seakeep.models.terms import Observable

DELAYS = {"input_delays": (2.0, 3.0, 5.0), "state_delays": (0.5, 1.0, 1.5)}
"""Delays that are tried, encounter periods."""
LENGTHS = (1.0, 0.6, 0.4)
"""Lengths of a filter that are tried, in parts of the one that is stated."""
LEADS = (0.0, 0.5, 0.75, 1.0)
"""Look-aheads that are tried, encounter periods."""
MEMORY = 8.0
"""Memory that is tried, encounter periods."""
Columns = tuple[ProbeAlignment | None, int | None, bool]
"""An alignment, the look-ahead in samples where it is part of that, and whether there is any."""
Step = Callable[[Any], list[Any]]
"""Candidates that differ from one in a setting; it is among them."""


@dataclass(frozen=True)
class Candidates:
    """What is tried of the settings that a search starts from.

    Parameters
    ----------
    base : HankelSettings
        Where it starts.
    given : TrainingRuns
        Training runs, and channels.
    period, step : float
        Encounter period, samples, and time step, s.
    vary, opened : sequence of str
        As for :func:`seakeep.models.selection.select`.
    unseen : bool
        Whether what is chosen must hold in sea states that no run holds.
    rivals : bool
        Whether other kinds of models are tried, which follow no surge.
    cut : int
        How many of the observables are left out that could be offered.
    remembers : bool
        Whether a memory is tried.
    """

    base: Any
    given: TrainingRuns
    period: float
    step: float
    vary: Sequence[str]
    opened: Sequence[str]
    unseen: bool
    rivals: bool
    cut: int = 0
    remembers: bool = True

    def shorter(self) -> Iterator[Candidates]:
        """The same with less and less that needs long runs."""
        for cut, remembers in itertools.product(range(3), (True, False)):
            yield replace(self, cut=cut, remembers=remembers)

    def left_open(self) -> list[Step]:
        """Steps through what the settings leave open."""
        steps = self._delays(self.opened)
        if "observables" in self.opened:
            steps.append(self._subsets)
        if {"alignment", "lead"} & {*self.opened}:
            steps.append(self._with_and_without)
        # A memory of the surge that waves are carried to fits one sea only.
        if "memory" in self.opened and self.remembers and not self.base.follows_surge:
            steps.append(self._remembering)
        return steps

    def varied(self) -> list[Step]:
        """Steps through what is varied."""
        follows = self.base.follows_surge
        tried = {"observables"} if follows else {"observables", "memory"}
        vary = {*self.vary} - (tried & {*self.opened})
        steps: list[Step] = []
        if "observables" in vary:
            steps.append(self._subsets)
        if "lead" in vary and not follows:
            steps.append(self._lengths("lead", LEADS))
        steps += self._delays(vary)
        if "memory" in vary and self.remembers:
            steps.append(self._remembering)
        if "alignment" in vary or ("lead" in vary and follows):
            steps.append(self._variants)
        return steps

    def _delays(self, names: Collection[str]) -> list[Step]:
        """Delays in periods, or the length of a filter in parts of its own."""
        if self.base.is_filter and "input_delays" in names:
            own = self.base.input_delays / self.period
            return [self._lengths("input_delays", [own * part for part in LENGTHS])]
        return [self._lengths(n, periods) for n, periods in DELAYS.items() if n in names]

    def _lengths(self, name: str, periods: Sequence[float]) -> Step:
        lengths = [round(each * self.period) for each in periods]
        return lambda best: [self._fitting(best, **{name: length}) for length in lengths]

    def _subsets(self, best: Any) -> list[Any]:
        every = self.offered(best)
        subsets = dict.fromkeys([(), *((each,) for each in every), every])
        return [replace(best, observables=each) for each in subsets]

    def _remembering(self, best: Any) -> list[Any]:
        return [best, replace(best, memory=round(MEMORY * self.period))]

    def _with_and_without(self, best: Any) -> list[Any]:
        """Alignment and look-ahead as stated, without one of them, and with nothing at all."""
        absent = {"alignment": None, "lead": 0}
        without = {name: absent[name] for name in absent if name in self.opened}
        pairs = itertools.product(
            *(dict.fromkeys([getattr(self.base, name), value]) for name, value in without.items())
        )
        tried = [self._fitting(best, **dict(zip(without, pair, strict=True))) for pair in pairs]
        return [*tried, replace(best, **without, observables=self.base.observables)]

    def _variants(self, best: Any) -> list[Any]:
        """Alignments, with each look-ahead that is tried where the model follows its own surge."""
        leads = [self.base.lead]
        leads += [round(p * self.period) for p in LEADS if p > LEAD and "lead" in self.vary]
        alignments = [self.base.alignment]
        if "alignment" in self.vary:
            alignments = alignments_of(self.base.alignment, self.given)
        candidates = []
        for each in alignments:
            aligned = replace(best, alignment=each)
            own = dict.fromkeys(leads if aligned.follows_surge else [best.lead])
            candidates += [self._fitting(aligned, lead=lead) for lead in own]
        return candidates

    def at_rest(self, best: Any) -> Any:
        """A candidate without the alignment to a predicted surge."""
        return self._fitting(best, alignment=None) if best.follows_surge else best

    def _fitting(self, best: Any, **changes: Any) -> Any:
        """A candidate with the observables of the same kinds that go with its other settings."""
        candidate, kinds = replace(best, **changes), {each.kind for each in best.observables}
        if self.base.observables:
            return candidate
        fitting = tuple(each for each in self.offered(candidate) if each.kind in kinds)
        return replace(candidate, observables=fitting)

    def offered(self, candidate: Any) -> tuple[Observable, ...]:
        """Observables to choose among beside the other settings of a candidate."""
        if self.base.observables or "observables" not in {*self.vary, *self.opened}:
            return self.base.observables
        ahead = int(candidate.lead) if candidate.follows_surge else None
        (name, run), *_ = self.given.runs.items()
        waves = labelled.elevations(run, self.given.inputs, name)
        every = default_observables(waves, self.period * self.step, self.unseen, ahead)
        if self._is_without(candidate):
            every = tuple(replace(o, lead=0.0) if isinstance(o, SlowSquares) else o for o in every)
        return every[self.cut :]

    def _is_without(self, candidate: Any) -> bool:
        """Whether a candidate lacks the look-ahead that is left open, and stated there alone."""
        is_open = "lead" in self.opened and not candidate.follows_surge
        squares = any(getattr(each, "lead", 0.0) for each in self.base.observables)
        return is_open and candidate.lead == 0 < self.base.lead and not squares

    def columns(self, candidate: Any) -> Columns:
        """What makes columns of their own."""
        ahead = candidate.lead if candidate.follows_surge else None
        return candidate.alignment, ahead, not self._is_without(candidate)

    def widest(self) -> dict[Columns, HankelSettings]:
        """Settings that hold the columns of all that is tried; those of the base are the first."""
        candidates = [self.base, *([self.at_rest(self.base)] * self.rivals)]
        for step_of in (*self.left_open(), *self.varied()):
            candidates += step_of(self.base)
        names = ("state_delays", "input_delays", "memory")
        longest = {name: max(getattr(each, name) for each in candidates) for name in names}
        alike: dict[Columns, list[Any]] = {}
        for each in candidates:
            alike.setdefault(self.columns(each), []).append(each)
        widest = {}
        for key, mine in alike.items():
            leads = [each.lead for each in mine]
            most = longest | {"lead": max(leads)}
            most["input_delays"] += max(leads) - min(leads)
            every = dict.fromkeys(o for each in mine for o in self.offered(each))
            widest[key] = mine[0].having(**most, observables=tuple(every))
        return widest


def default_observables(
    elevations: tuple[str, ...],
    period: float | None = None,
    unseen: bool = False,
    follows: int | None = None,
) -> tuple[Observable, ...]:
    """Slow squares of the elevation at the vessel, or of all, and powers of all elevations.

    `period` is the encounter period, s; by default that of the training runs. Where what is chosen
    must hold in sea states that are `unseen`, several elevations give their envelopes alone,
    without a look-ahead: few training seas do not tell how a force is weighed by frequency, and
    probes away from the vessel see the waves before it. A model that `follows` its own surge and
    looks so many samples ahead takes a filter of one period that reads no further than its waves;
    without a look-ahead the squares of all elevations, of which those up-wave tell what comes.
    """
    if not elevations:
        return ()
    at_vessel = tuple(name for name in elevations if name == "eta_cog") or elevations
    slow = SlowSquares(at_vessel, period=period)
    if follows is not None:
        lead, of = (0.75, at_vessel) if follows else (0.0, elevations)
        slow = replace(slow, of=of, cutoff=1.0, lead=lead)
    elif unseen and len(at_vessel) > 1:
        slow = replace(slow, orders=(0,), lead=0.0)
    return slow, Powers(elevations)


def alignments_of(
    stated: ProbeAlignment | None, given: TrainingRuns
) -> list[ProbeAlignment | None]:
    """Alignments that these runs allow and that differ, the stated one first, and none.

    None reads the measured surge: what is read after a start is no choice of a setting.
    """
    base = replace(stated or ProbeAlignment(), optional=False)
    carried = replace(base, mode="dispersion", celerity=None)
    alignments: list[ProbeAlignment | None] = []
    for alignment in (
        replace(carried, surge="predicted"),
        replace(carried, surge="none"),
        replace(base, mode="effective", surge="none"),
    ):
        try:
            fitted = alignment.fit(*given, None)
        except (RequestError, DataError):
            continue  # no depth, no positions, or no surge among the states
        assert isinstance(fitted, FittedAlignment)
        if alignment.surge == "predicted" or any(
            any(fitted.rig(run).offsets) for run in given.runs.values()
        ):
            alignments.append(alignment)
    first = None if stated is None else base
    return sorted([*alignments, None], key=lambda each: each != first)
