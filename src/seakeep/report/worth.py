"""The first screen of the page of ``seakeep check``: error beside baselines, and a verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from seakeep.check import Checked
from seakeep.report.section import Section
from seakeep.report.tables import MISSING, Table, change, interval, number

__all__ = ["worth_section"]

USES = {
    0.1: "can stand in for a measurement (error below 0.1 SD)",
    0.3: "can be used instant by instant (error below 0.3 SD)",
    0.7: "shows trends, not instants (error below 0.7 SD)",
    np.inf: "cannot be used instant by instant (error not surely below 0.7 SD)",
}
"""What the limit of the error allows."""


def worth_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return the error over the tests beside that of baselines, the look-ahead and the verdict."""
    points = [*_verdicts(found, checked.repeats), *_conditions(found)]
    if lost := found.attrs["lost"]:
        points.append(f"Baselines that do not count in all verdicts: {lost}.")
    if (validity := checked.found.get("validity")) is not None:
        points += [
            f"{run}: outside what trained the model ({why})."
            for run, why in zip(validity["run"].values, validity["outside"].values, strict=True)
            if why
        ]
    words = [
        f"Free runs from one measured start to the end of each {_one(found)} "
        f"({found.sizes['run']}); errors in measured SDs of the run. A verdict "
        "reads the upper bound of the 95 % interval of the error: below 0.1 (99 % of the variance "
        "is forecast), 0.3 (91 %), 0.7 (51 %). Better than a baseline: the paired 95 % interval of "
        "the change of the error lies below zero. Intervals hold for these runs."
    ]
    tables = [_by_run(found), _by_state(found), _of_runs(found)]
    return Section("worth", "What the model is worth", words, points, tables=tables)


def _one(found: xr.Dataset) -> str:
    """What a run is: a test, or training."""
    return str(found.attrs["of"]).removesuffix("s")


def _verdicts(found: xr.Dataset, repeats: Mapping[str, str]) -> Iterator[str]:
    """One sentence on all states in each kind of waves, and one per group of alike states."""
    if found.attrs["of"] == "training":
        yield "No run tests the model. All errors are those of training: memory, not skill."
    for kind in found["waves"].values:
        own = found.sel(waves=kind)
        names = [str(run) for run in found["run"].values[found["kind"].values == kind]]
        count, known = len(names), [run for run in names if run in repeats]
        memory = f" (memory, not skill: {', '.join(known)} repeat training input)" * bool(known)
        tests = "training" if found.attrs["of"] == "training" else f"test{'s' * (count > 1)}"
        every = own.sel(state="all", model="model")
        yield (
            f"{count} {tests} in {kind} waves: ANRMSE "
            f"{interval(every, 'nrmse', every['nrmse'])}{_beside(own)}."
        )
        groups: dict[tuple[float, str], list[str]] = {}
        for state in found["state"].values[1:]:
            groups.setdefault(_verdict(own.sel(state=state)), []).append(str(state))
        for (_, use), alike in sorted(groups.items(), key=lambda each: (not each[0][0], each[0])):
            yield f"{kind.capitalize()} waves, {', '.join(alike)}: {use}{memory}."


def _verdict(one: xr.Dataset) -> tuple[float, str]:
    """Limit of a state (0 where none can be judged), and what its error allows, in words."""
    limit = float(one["limit"].fillna(0))
    if not limit:
        why = (
            "it stands still in one of these runs or more"
            if bool(one["still"])
            else "its forecast is lost"
        )
        return limit, f"cannot be judged: {why}"
    use, rival = USES[limit], str(one["rival"].values)
    if not rival or bool(one["better"]):
        return limit, use
    at = one.sel(model=rival)
    how = "worse" if float(at["change_lower"]) > 0 else "not shown to be better"
    beside = f" ({_change(at)})".replace(f" ({MISSING})", "")
    return limit, f"{use}; {how} than the baseline {rival}{beside}"


def _change(at: xr.Dataset) -> str:
    """Interval of the change from a baseline."""
    return change(*(1 + float(at[f"change_{each}"]) for each in ("lower", "upper")))


def _beside(own: xr.Dataset) -> str:
    """The best baseline, and how far the model lies below it."""
    one = own.sel(state="all")
    if not (best := str(one["best"].values)):
        return ""
    at = one.sel(model=best)
    beside = f" (from there {_change(at)})".replace(f" (from there {MISSING})", "")
    return f"; of the best baseline, {best}, {number(at['nrmse'])}{beside}"


def _conditions(found: xr.Dataset) -> Iterator[str]:
    """What the forecasts read after their start."""
    ahead = float(found["look_ahead"].max())
    if ahead > 0:
        yield (
            f"Look-ahead: the model reads the waves up to {ahead:.3g} s after the instant that it "
            "forecasts. They must be measured up-wave, or predicted."
        )
    else:
        yield "Look-ahead: none. No wave after the instant of the forecast is read."
    if state := found.attrs["conditional_on"]:
        yield f"All errors are conditional on measured {state}, which is read after the start."


def _by_run(found: xr.Dataset) -> Table:
    """ANRMSE of each test, of the model with its interval and of the baselines."""
    rows, averages, models = [], [], found["model"].values
    for kind in found["waves"].values:
        for run in found["run"].values[found["kind"].values == kind]:
            at = found.sel(run=run)
            rows.append((str(run), *_cells(at, "anrmse")))
        averages.append(len(rows))
        rows.append((f"mean, {kind} waves", *_cells(found.sel(waves=kind, state="all"), "nrmse")))
    return Table(
        "worth",
        "ANRMSE of the model and of baselines",
        (_one(found), "model", "95 %", *map(str, models[1:])),
        rows,
        "Baselines are fitted to the training runs with their recommended settings, and read no "
        "wave after the instant that they forecast and no measured state after the start."
        if len(models) > 1
        else "",
        range(1, 2 + len(models)),
        averages=tuple(averages),
        heat=(1, *range(3, 2 + len(models))),
    )


def _cells(at: xr.Dataset, key: str) -> tuple[str, ...]:
    first, *others = map(number, at[key].values)
    return (first, interval(at.sel(model="model"), key), *others)


def _by_state(found: xr.Dataset) -> Table:
    """Mean error of each state, the best baseline, and the verdict."""
    rows = []
    for kind in found["waves"].values:
        for state in found["state"].values[1:]:
            one = found.sel(waves=kind, state=state)
            cells, best = _cells(one, "nrmse"), str(one["best"].values)
            beside = (MISSING, MISSING, MISSING)
            if best:
                at = one.sel(model=best)
                beside = (best, number(at["nrmse"]), _change(at))
            use = USES.get(float(one["limit"]), "not judged").partition(" (")[0]
            rows.append((str(state), str(kind), *cells[:2], *beside, use))
    columns = ("state", "waves", "NRMSE", "95 %", "best baseline", "its NRMSE", "change", "verdict")
    return Table(
        "verdicts",
        "NRMSE of each state, mean over runs, and the verdict",
        columns,
        rows,
        "Change: from the best baseline to the model, paired 95 % interval.",
        (2, 3, 5, 6),
        folded=True,
    )


def _of_runs(found: xr.Dataset) -> Table:
    """Error of each state in each run, which no mean hides."""
    errors = found["run_nrmse"]
    runs = [str(run) for run in errors["run"].values]
    rows = [(str(row["channel"].values), *map(number, row)) for row in errors]
    title, every = "NRMSE of each state in each run", range(1, 1 + len(runs))
    return Table("worth_of_runs", title, ("state", *runs), rows, "", every, heat=every, folded=True)
