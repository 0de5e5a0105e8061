"""``seakeep.tune``: choice of settings by free runs on held-out training runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping, MutableMapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, Progress, plain
from seakeep.errors import RequestError
from seakeep.files import read_bytes, write_text
from seakeep.models import HankelDMDc
from seakeep.models.baselines import RIVALS
from seakeep.models.labelled import Runs, Stop, TrainingRuns, channel_matrix
from seakeep.models.readouts import readouts_json
from seakeep.models.selection import Selected, select
from seakeep.models.settings import FOLDS, Folds, HankelSettings, Select
from seakeep.models.specs import largest_radius
from seakeep.toml import Length

if TYPE_CHECKING:
    from seakeep.report.style import Figure

LENGTHS = ("state_delays", "input_delays", "lead", "memory")
FIRST = "# seakeep_file: tuned campaign\n"
COLUMNS = {
    "state_delays": "state delays",
    "input_delays": "input delays",
    "lead": "lead",
    "observables": "observables",
    "alignment": "alignment",
    "memory": "memory",
    "kind": "kind",
    "ridge": "λ per snapshot pair",
    "score": "mean NRMSE of free runs",
    "lower": "lower bound of the 95 % interval of the score",
    "upper": "upper bound of the 95 % interval of the score",
    "chosen": "chosen",
}
"""Columns of the table of what was tried, in words."""


@dataclass(frozen=True, eq=False)
class TuneResult(Selected[Any]):
    """Result of :func:`tune`.

    Parameters
    ----------
    settings : HankelDMDc, FIR, ARX or Subspace
        The settings that were chosen; another kind than the first where that is varied and better.
        Their ``fit(runs, states, inputs)`` fits the model.
    rows : tuple of dict
        What was tried, as in :attr:`table`.
    note : str
        How the choice was made.
    readouts : tuple of FittedReadOut
        Read-outs of the settings that were chosen, as all training runs teach them; those that
        were chosen among have their scores.
    """

    @property
    def table(self) -> xr.Dataset:
        """What was tried, a Dataset over ``trial``.

        ``state_delays``, ``input_delays``, ``lead`` (samples), ``observables`` (their kinds),
        ``alignment``, ``memory`` (samples), ``kind``, ``ridge`` (per snapshot pair), ``score``
        (mean NRMSE of free runs), the bounds ``lower`` and ``upper`` of its 95 % interval,
        ``chosen``.
        """
        return xr.Dataset(
            {
                key: ("trial", np.array([row[key] for row in self.rows]), {"long_name": words})
                for key, words in COLUMNS.items()
            }
        )

    def describe(self) -> str:
        """Text: how the choice was made, the best λ of each candidate, and the read-outs.

        Returns
        -------
        str
        """
        return "\n".join([super().describe(), *(each.describe() for each in self.readouts)])

    def figure(self) -> Figure:
        """Draw the error against λ, a line per candidate; needs the extra ``figures``.

        Returns
        -------
        Figure
        """
        from seakeep.report.figures.errors import tuning_figure

        return tuning_figure(self.table)


def tune(
    spec: HankelDMDc,
    runs: Runs,
    states: Sequence[str],
    inputs: Sequence[str],
    vary: Sequence[str] = ("ridge", "observables"),
    horizon: Sequence[float] = (15.0, 45.0),
    folds: Folds | int = "auto",
    *,
    stop: Stop = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | Path | None = None,
) -> TuneResult:
    """Choose settings by the error of free runs on training runs that are held out in turn.

    Parameters
    ----------
    spec : HankelDMDc
        Where the search starts, with exact delay rows: with what `fit` would choose of what
        ``spec.select`` leaves open. What `vary` does not name stays, and the start is left only
        for what errs less by more than a standard error over what is held out. The period of
        ``spec.select`` is that of the lengths.
    runs : Dataset, sequence of Dataset, or mapping of names to Datasets
        Training runs.
    states, inputs : sequence of str
        Channels of the model.
    vary : sequence of str, optional
        Out of "ridge" (always chosen: every fourth λ of a path, and those about the best, unless a
        candidate errs a fifth more than another), "observables" (none, slow squares, powers,
        both; or those of the spec), "lead", "input_delays", "state_delays", "memory" (none, or
        eight periods), "alignment" (none, dispersion or one celerity, to the surge that is
        predicted or to the place at rest: what the runs allow), "readouts" (none or by the wave at
        the line, for those of the spec or for every load) and "kind" (FIR, ARX and subspace models
        in the place of what the rest chose, with its delays and inputs, and no alignment to a
        predicted surge).
    horizon : sequence of float, optional
        Lengths of the free runs, encounter periods.
    folds : {"auto", "run", "sea_state"} or int, optional
        What is held out in turn: a run and the runs that repeat its waves, a run alone, all runs
        of a sea state, or a part of a run: their number. A single run is held out in three parts.
    stop : float, sequence or mapping of float, optional
        Last instant of the training window of the runs, s.
    executor : concurrent.futures.Executor, optional
        Works on several candidates side by side; the result is the same.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    resume : str or Path, optional
        File that keeps the scores, so that an interrupted search continues.

    Returns
    -------
    TuneResult
        Settings, table, figure.

    Raises
    ------
    RequestError
        If `vary` names something else, the delay rows are not exact, or a file to resume is of
        other runs or settings.
    DataError
        As :meth:`HankelDMDc.fit`.
    """
    number = isinstance(folds, int) and not isinstance(folds, bool) and folds >= 2
    if not number and folds not in FOLDS:
        raise RequestError(
            f"folds must be {', '.join(map(repr, FOLDS))} or an integer of at least 2; received "
            f"{folds!r}."
        )
    given = TrainingRuns.of(runs, states, inputs, stop)
    known: MutableMapping[str, Any] = {}
    if resume is not None:
        asked = [spec.to_json(), sorted(vary), list(horizon), folds]
        known = _Scores(Path(resume), _digest(asked, given.runs, [*given.states, *given.inputs]))
    spec = spec.resolved_in(given.runs, given.inputs)
    open_to = spec.select or Select()
    found = select(
        spec,
        *given,
        vary=vary,
        opened=open_to.opened,
        horizon=horizon,
        folds=folds,
        period=open_to.period,
        kinds=RIVALS if "kind" in vary else (),
        executor=executor,
        progress=progress,
        known=known,
    )
    settings, note = found.settings.having(select=None), found.note
    if getattr(settings, "parameter", ""):  # which the search leaves out, as pooled models do
        start = spec.settled(*given, executor=executor).settings
        every = spec.variants(given, start, settings)
        sound = (each for each in every if largest_radius(each[0].fit(*given)) < 1.0)
        settings, words = next(sound, every[-1])
        note = words + note
    return TuneResult(**vars(replace(found, settings=settings, note=note)))


def _digest(asked: object, runs: Datasets, channels: Sequence[str]) -> str:
    """Checksum of what a search depends on."""
    digest = hashlib.sha256(json.dumps(asked, sort_keys=True).encode())
    for name, run in runs.items():
        digest.update(name.encode())
        facts = {key: run[key].attrs for key in channels} | {"run": run.attrs}
        digest.update(repr(facts).encode())
        for values in (run["time"].values, channel_matrix(run, channels, name)):
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


class _Scores(dict[str, Any]):
    """Scores in a file: each one that is added is written."""

    def __init__(self, path: Path, digest: str) -> None:
        self.path, self.digest = path, digest
        if path.exists():
            try:
                content = json.loads(read_bytes(path))
                known, scores = content["digest"], dict(content["scores"])
            except (ValueError, LookupError, TypeError) as error:
                raise RequestError(
                    f"{path} keeps no scores of a search ({error}). Name another file, or remove "
                    "it."
                ) from None
            if known != digest:
                raise RequestError(
                    f"{path} keeps scores of other runs or settings. Name another file, or remove "
                    "it to start anew."
                )
            self.update(scores)

    def __setitem__(self, key: str, value: Any) -> None:
        super().__setitem__(key, value)
        write_text(self.path, json.dumps({"digest": self.digest, "scores": self}))


def tuned_campaign(
    text: str,
    model: str | None,
    spec: HankelSettings,
    varied: Collection[str],
    preset: str | None,
    period: float | None,
) -> str:
    """Write a choice into the table of a model in a campaign file; all else stays as it was.

    Parameters
    ----------
    text : str
        The campaign file.
    model : str or None
        Key in ``[models.NAME]``; None for the table ``[model]``.
    spec : HankelSettings
        The settings that were chosen; keys of the table that their kind lacks go.
    varied : collection of str
        What they were chosen among; the ridge always.
    preset : str or None
        What the table takes, stated or not.
    period : float or None
        Encounter period, samples; None writes lengths in samples.

    Returns
    -------
    str
    """
    import tomlkit
    from tomlkit.items import Table

    document = tomlkit.parse(text)
    table = document["model"] if model is None else document["models"][model]
    # Blank lines and comments there belong to the next table, if this one is in one place.
    between: list[Any] = []
    body = _end(table) if isinstance(table, Table) else []
    while body and body[-1][0] is None:
        between.insert(0, body.pop())
    values = _choice(spec, table, varied, preset, period)
    stale = {"select", "rank"}  # nothing is left to be chosen
    stale |= {each.name for each in fields(HankelDMDc) if "kind" in values}
    if not getattr(spec, "parameter", ""):
        stale.add("parameter")
    stale |= ({"alignment"} & set(varied)) | ({"observables", "readouts"} & set(values))
    for key in stale | ({"preset"} - set(values)):
        table.pop(key, None)
    for key, value in values.items():
        if table.get(key) != value:
            table[key] = value
            if key in ("ridge", *LENGTHS):
                table[key].comment("chosen by seakeep tune, by free runs on held-out training runs")
    if between:
        _end(table).extend(between)
    return f"{FIRST}{tomlkit.dumps(document).removeprefix(FIRST)}"


def _choice(
    spec: HankelSettings,
    table: Mapping[str, Any],
    varied: Collection[str],
    preset: str | None,
    period: float | None,
) -> dict[str, Any]:
    """Keys of the table of a model that state the choice, and the preset that it goes with."""
    values: dict[str, Any] = {"ridge": spec.ridge, "ridge_scale": spec.ridge_scale}
    stated = set(varied)
    if spec.kind != HankelDMDc.kind:  # which takes no key of the table but those stated here
        stated, preset = {each.name for each in fields(spec) if each.init}, None
        values = {"kind": spec.kind} | {key: v for key, v in values.items() if key in stated}
    if preset and "alignment" in varied and not spec.alignment:
        # The preset may bring an alignment, so that all which it states is stated in its place.
        stated |= {"readouts", *LENGTHS}
        values["delay_rows"] = spec.delay_rows
    elif preset:
        values["preset"] = preset
    for key in (each for each in LENGTHS if each in stated):
        count: int = getattr(spec, key)
        values[key] = count if isinstance(table.get(key), int) else _in_periods(count, period)
    if "observables" in stated:
        values["observables"] = [{"kind": o.kind} | _stated(o) for o in spec.observables]
    if "alignment" in stated and spec.alignment:
        values["alignment"] = _stated(spec.alignment, "mode", "surge")
    if "readouts" in stated:
        values["readouts"] = readouts_json(spec.readouts)
    return values


def _stated(settings: Any, *always: str) -> dict[str, Any]:
    """Settings that differ from their defaults, and those that are stated always."""
    default = {each.name: each.default for each in fields(settings)}
    return {
        key: plain(value)
        for key, value in vars(settings).items()
        if key in always or value != default[key]
    }


def _in_periods(samples: int, period: float | None) -> int | str:
    """A number of samples as a file states it: in periods, which serve any sampling rate."""
    if not period:
        return samples
    lengths = (Length(float(f"{samples / period:.{digits}g}")) for digits in range(2, 16))
    return str(next(each for each in lengths if round(each.at(period)) == samples))


def _end(table: Any) -> list[Any]:
    """Keys and items, lines without a key too, of the table that stands last inside a table."""
    from tomlkit.items import AoT, Table

    body = table.value.body
    last = next((item for key, item in reversed(body) if key is not None), None)
    last = last[-1] if isinstance(last, AoT) else last
    return _end(last) if isinstance(last, Table) else body
