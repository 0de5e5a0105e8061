"""A band calibrated on windows that the members never saw."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, get_args

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, fraction, whole_number
from seakeep.core.calibration import ConformalMargin, band_scores, conformal_margin
from seakeep.errors import RequestError, SeakeepWarning
from seakeep.models import labelled
from seakeep.models.checks import check_choice
from seakeep.models.engine import Runs as FreeRuns
from seakeep.models.engine import member_series, read_windows
from seakeep.models.executor import Progress
from seakeep.models.members import TrainingArrays
from seakeep.models.summaries import STATISTICS, reduce_members

__all__ = [
    "Band",
    "Calibration",
    "calibrate",
    "check_band",
    "held_out_scores",
    "warn_of_horizon",
    "widened",
]

Band = Literal["members", "calibrated"]
NUMBERS = ("margin", "block_length", "blocks", "warranted")


class Ensemble(FreeRuns, Protocol):
    """What a calibration must know of an ensemble."""

    @property
    def arrays(self) -> TrainingArrays: ...
    @property
    def read_spans(self) -> dict[str, tuple[float, float]]: ...


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a band was widened by, and on what that was found.

    Parameters
    ----------
    found : ConformalMargin
        Margins of the states.
    windows : dict of str to int
        Number of windows in each run.
    steps : int
        Instants of a window.
    spans : dict of str to (float, float)
        First start and last instant of the windows in each run, s; empty where a file does not
        say.
    """

    found: ConformalMargin
    windows: dict[str, int]
    steps: int
    spans: dict[str, tuple[float, float]] = field(default_factory=dict)

    def to_json(self) -> str:
        """As text; a margin that is infinite is kept as such."""
        arrays = {key: getattr(self.found, key).tolist() for key in NUMBERS}
        words = {"level": self.found.level, "windows": self.windows, "steps": self.steps}
        words["spans"] = self.spans
        return json.dumps(arrays | words)

    @classmethod
    def from_json(cls, text: str) -> Calibration | None:
        """Rebuild from :meth:`to_json`; None of ``null``."""
        kept: dict[str, Any] | None = json.loads(text)
        if kept is None:
            return None
        arrays = {key: np.array(kept[key]) for key in NUMBERS}
        found = ConformalMargin(**arrays, level=float(kept["level"]))
        spans = {name: (float(a), float(b)) for name, (a, b) in kept.get("spans", {}).items()}
        return cls(found, dict(kept["windows"]), int(kept["steps"]), spans)


def calibrate(
    ensemble: Ensemble,
    runs: labelled.Runs,
    steps: int,
    level: float,
    executor: Executor | None,
    progress: Progress | None = None,
) -> Calibration:
    """Find the margins of an ensemble; see :meth:`HankelEnsemble.calibrate`."""
    named = labelled.as_runs(runs)
    level = fraction(level, "level")
    free = _free_starts(ensemble, named, steps)
    scores = _scores(ensemble, named, free, steps, level, executor, progress)
    history = ensemble.signature.history_samples
    if not scores:
        longest = (
            max(run.sizes["time"] for run in named.values()) - ensemble.signature.history_samples
        )
        reason = "members have read what is left of them"
        if longest < steps:
            reason = f"at most {max(longest, 0)} steps fit into the longest of them"
        raise RequestError(
            f"no window of {steps} steps with {history} samples of history is "
            f"free in {', '.join(named)}, as given here: {reason}. Give fewer steps, longer parts, "
            "or runs that do not train."
        )
    margin = conformal_margin(np.concatenate(list(scores.values())), level)
    windows = {name: len(each) for name, each in scores.items()}
    spans = {
        n: (starts[0], starts[-1] + steps * ensemble.signature.dt) for n, starts in free.items()
    }
    return Calibration(margin, windows, steps, spans)


def held_out_scores(
    ensemble: Ensemble,
    runs: Mapping[str, xr.Dataset],
    steps: int,
    level: float,
    executor: Executor | None = None,
) -> dict[str, FloatArray]:
    """Scores of the band in windows end to end, none of which a member has read.

    Parameters
    ----------
    ensemble : Ensemble
        The ensemble.
    runs : mapping of str to Dataset
        Runs, or parts of runs, under the names by which they trained.
    steps : int
        Instants of a window.
    level : float
        Probability between the bounds.
    executor : Executor, optional
        As in :meth:`HankelEnsemble.forecast`.

    Returns
    -------
    dict of str to ndarray, each of shape (window, steps, N)
        Runs in which there is such a window.
    """
    level = fraction(level, "level")
    return _scores(ensemble, runs, _free_starts(ensemble, runs, steps), steps, level, executor)


def _free_starts(
    ensemble: Ensemble, runs: Mapping[str, xr.Dataset], steps: int
) -> dict[str, list[float]]:
    """Starts of the windows of each run in which there are any."""
    free = {name: _unread_starts(ensemble, name, run, steps) for name, run in runs.items()}
    return {name: starts for name, starts in free.items() if starts}


def _scores(
    ensemble: Ensemble,
    runs: Mapping[str, xr.Dataset],
    free: Mapping[str, list[float]],
    steps: int,
    level: float,
    executor: Executor | None,
    progress: Progress | None = None,
) -> dict[str, FloatArray]:
    """Scores in windows from these starts; a step of progress is a member in one of the runs."""
    found: dict[str, FloatArray] = {}
    for number, (name, starts) in enumerate(free.items()):
        run = runs[name]
        tell = None if progress is None else _counted(progress, number, len(free), name)
        places = [(name, start) for start in starts]
        windows = read_windows(ensemble.signature, {name: run}, places, steps)
        with member_series(ensemble, windows, executor, tell) as (series, lost):
            values = reduce_members(series, lost, level)
        lower, upper = (values[:, STATISTICS.index(key)] for key in ("lower", "upper"))
        measured = np.stack(
            [_measured(ensemble, run, name, start, steps) for _, start in windows.places]
        )
        found[name] = band_scores(lower, upper, measured)
    return found


def _counted(progress: Progress, before: int, runs: int, name: str) -> Progress:
    """Progress over the members of one run, as part of several."""
    return lambda done, total, what: progress(
        before * total + done, runs * total, f"{name}, {what}"
    )


def _unread_starts(ensemble: Ensemble, name: str, run: xr.Dataset, steps: int) -> list[float]:
    """Starts of windows end to end in a run, clear of what members have read of it."""
    whole_number(steps, "steps")
    time = np.asarray(run["time"].values, dtype=float)
    slack = 1e-6 * ensemble.signature.dt
    read = _read_span(ensemble, name, run)
    starts, at = [], ensemble.signature.history_samples - 1
    while at + steps < time.size:
        # The instants at + 1 … at + steps are forecast.
        if read and time[at + 1] <= read[1] + slack and time[at + steps] >= read[0] - slack:
            at = max(at, int(np.searchsorted(time, read[1] - slack)))
            read = None
            continue
        starts.append(float(time[at]))
        at += steps
    return starts


def _read_span(ensemble: Ensemble, name: str, run: xr.Dataset) -> tuple[float, float] | None:
    """What members have read of a run: of the one that holds their samples, else of its name.

    A name that was made up for a run without one says nothing.
    """
    arrays, spans = ensemble.arrays, ensemble.read_spans
    for key, begin, states in zip(arrays.names, arrays.begins, arrays.states, strict=True):
        if key in spans and _holds(run, ensemble, name, begin, states):
            return spans[key]
    return None if labelled.is_made_up(name, run) else spans.get(name)


def _holds(
    run: xr.Dataset, ensemble: Ensemble, name: str, begin: float, states: FloatArray
) -> bool:
    """Whether a run has the same states at the same instants, as far as both reach."""
    time = np.asarray(run["time"].values, dtype=float)
    if not time.size:
        return False
    dt = ensemble.signature.dt
    ahead = round((begin - time[0]) / dt)  # samples of the run before the states
    first, skipped = max(ahead, 0), max(-ahead, 0)
    count = min(time.size - first, len(states) - skipped)
    if (
        count < 1
        or abs(time[first] - begin - skipped * ensemble.signature.dt) > 0.5 * ensemble.signature.dt
    ):
        return False
    held = labelled.channel_matrix(
        run, ensemble.signature.states, name, slice(first, first + count)
    )
    return bool(np.array_equal(held, states[skipped : skipped + count]))


def _measured(
    ensemble: Ensemble, run: xr.Dataset, name: str, start: float, steps: int
) -> FloatArray:
    at = labelled.nearest_sample(np.asarray(run["time"].values, dtype=float), start, name)
    return labelled.channel_matrix(
        run, ensemble.signature.states, name, slice(at + 1, at + 1 + steps)
    )


def check_band(calibration: Calibration | None, level: float, band: Band) -> None:
    """Refuse a band that the ensemble does not have.

    Parameters
    ----------
    calibration : Calibration or None
        Of the ensemble.
    level : float
        Probability that is asked of the band.
    band : {"members", "calibrated"}
        Which band.

    Raises
    ------
    RequestError
        If the ensemble was not calibrated, or for another level, or there is no such band.
    """
    check_choice("band", band, get_args(Band))
    if band == "members":
        return
    if calibration is None:
        raise RequestError(
            "the ensemble is not calibrated. Call ensemble.calibrate(runs, steps), or seakeep "
            "calibrate, with runs that its members did not learn from, and use the result."
        )
    known = calibration.found.level
    if abs(known - level) > 1e-12:
        raise RequestError(
            f"the band was calibrated for level = {known:g}, and {level:g} was asked for. "
            "Calibrate for that level."
        )


def warn_of_horizon(
    calibration: Calibration | None, name: str, steps: int, stacklevel: int = 4
) -> None:
    """Warn where a forecast is longer than those that its calibrated band was made from."""
    if calibration is not None and steps > calibration.steps:
        warnings.warn(
            f"the forecast of {name} is longer than the {calibration.steps} instants that "
            "the band was calibrated for: its coverage is not warranted there. Calibrate with "
            "longer windows.",
            SeakeepWarning,
            stacklevel=stacklevel,
        )


def widened(calibration: Calibration | None, values: FloatArray, band: Band) -> FloatArray:
    """Statistics of shape (…, 4, steps, N) with the bounds of a band that was checked."""
    if band == "members" or calibration is None:
        return values
    out, margin = values.copy(), calibration.found.margin
    out[..., STATISTICS.index("lower"), :, :] -= margin
    out[..., STATISTICS.index("upper"), :, :] += margin
    return out
