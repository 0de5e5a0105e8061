"""The page of ``seakeep check``: what a model is worth, section by section."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from seakeep.check import Checked
from seakeep.conventions import is_elevation
from seakeep.report.figures import checks
from seakeep.report.page import Section, drawing, section
from seakeep.report.style import prefixed, shown_unit
from seakeep.report.tables import (
    MISSING,
    WORDS,
    Number,
    Table,
    entries,
    interval,
    number,
    numbers,
    ratio_of,
    row,
    table,
)

OVERSHOOT = 1.1
"""Largest swing over the offset that a free decay may show; the rest is for the noise of a fit."""
SLOWEST = 12
"""Modes in the table, as in the figure: what decays faster is seldom a motion of the vessel."""
TURNED = -0.8
"""Correlation of forecast and measurement below which one of them looks turned over."""
RARE = 0.01
"""Chance of so large a peak, or trough, below which the law fitted does not hold for it."""

USES = {
    0.1: "can stand in for a measurement (error below 0.1 SD)",
    0.3: "can be used instant by instant (error below 0.3 SD)",
    0.7: "shows trends, not instants (error below 0.7 SD)",
    np.inf: "cannot be used instant by instant (error not surely below 0.7 SD)",
}
"""What the limit of the error allows."""


def worth_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return the error over the tests beside that of baselines, the look-ahead and the verdict."""
    ahead = "none. No input after the instant of the forecast is read."
    if (seconds := float(result["look_ahead"].max())) > 0:
        ahead = (
            f"the model reads the inputs up to {seconds:.3g} s after the instant that it "
            "forecasts. They must be measured up-wave, or predicted."
        )
    points = [*_verdicts(result, checked.repeats), f"Look-ahead: {ahead}"]
    if state := result.attrs["conditional_on"]:
        points.append(
            f"All errors are conditional on measured {state}, which is read after the start."
        )
    if lost := result.attrs["lost"]:
        points.append(f"Baselines that do not count in all verdicts: {lost}.")
    if validity := checked.results.get("validity"):
        points += [
            f"{run}: outside what trained the model ({why})." for run, why in _outside(validity)
        ]
    verdicts = []
    for own in entries(result.isel(state=slice(1, None)), "waves", "state"):
        best, beside = own["best"].item(), (MISSING,) * 3
        if best:
            beside = best, number(own["nrmse"].sel(model=best)), _change(own, best)
        use = USES.get(float(own["limit"]), "not judged").partition(" (")[0]
        verdicts.append((*row(own, "state", "waves"), *_cells(own, "nrmse")[:2], *beside, use))
    one, runs = result.attrs["of"].removesuffix("s"), result["run"].values
    errors = [(each["channel"].item(), *numbers(each)) for each in result["run_nrmse"]]
    return section(
        "worth",
        _by_run(result, one),
        table("verdicts", verdicts),
        table("worth_of_runs", errors, columns=("state", *runs)),
        one=one,
        runs=runs.size,
        points=points,
    )


def _verdicts(result: xr.Dataset, repeats: Mapping[str, str]) -> Iterator[str]:
    """One sentence on all states in each kind of waves, and one per group of alike states."""
    training = result.attrs["of"] == "training"
    if training:
        yield "No run tests the model. All errors are those of training: memory, not skill."
    for kind in result["waves"].values:
        own = result.sel(waves=kind)
        names = result["run"].values[result["kind"].values == kind]
        known = ", ".join(run for run in names if run in repeats)
        memory = f" (memory, not skill: {known} repeat training input)" * bool(known)
        tests = "training" if training else f"test{'s' * (len(names) > 1)}"
        one = own.sel(state="all")
        every = one.sel(model="model")
        beside = ""
        if best := one["best"].item():
            beside = f"; of the best baseline, {best}, {number(one['nrmse'].sel(model=best))}"
            if (below := _change(one, best)) != MISSING:
                beside += f" (from there {below})"
        bounds = interval(every, "nrmse")
        error = number(every["nrmse"]) + f" ({bounds})" * (bounds != MISSING)
        yield f"{len(names)} {tests} in {kind} waves: ANRMSE {error}{beside}."
        groups = defaultdict(list)
        for state in result["state"].values[1:]:
            groups[_verdict(own.sel(state=state))].append(str(state))
        for (_, use), alike in sorted(groups.items(), key=lambda each: (not each[0][0], each[0])):
            yield f"{kind.capitalize()} waves, {', '.join(alike)}: {use}{memory}."


def _verdict(one: xr.Dataset) -> tuple[float, str]:
    """Limit of a state (0 where none can be judged), and what its error allows, in words."""
    limit, rival = float(one["limit"].fillna(0)), one["rival"].item()
    if not limit:
        still = "it stands still in one of these runs or more"
        return limit, f"cannot be judged: {still if one['still'] else 'its forecast is lost'}"
    if not rival or one["better"]:
        return limit, USES[limit]
    worse = one["change_lower"].sel(model=rival) > 0
    how, by = "worse" if worse else "not shown to be better", _change(one, rival)
    beside = f" ({by})" * (by != MISSING)
    return limit, f"{USES[limit]}; {how} than the baseline {rival}{beside}"


def _change(one: xr.Dataset, baseline: str) -> Number:
    """Interval of the change from a baseline."""
    at = one.sel(model=baseline).rename(change_lower="lower", change_upper="upper")
    return ratio_of(at).cells()[1]


def _by_run(result: xr.Dataset, one: str) -> Table:
    """ANRMSE of each test, of the model with its interval and of the baselines."""
    rows, averages, models = [], [], result["model"].values
    for own in entries(result, "waves"):
        kind = own["waves"].item()
        of_kind = entries(result.sel(run=result["kind"] == kind), "run")
        rows += [(*row(at, "run"), *_cells(at, "anrmse")) for at in of_kind]
        averages.append(len(rows))
        rows.append((f"mean, {kind} waves", *_cells(own.sel(state="all"), "nrmse")))
    note = (
        "Baselines are fitted to the training runs with their recommended settings and the model's "
        "look-ahead, alignment and observables."
    ) * (len(models) > 1)
    heads = (one, "model", "95 %", *models[1:])
    return table("worth", rows, columns=heads, more=note, averages=averages)


def _cells(at: xr.Dataset, key: str) -> list[Number]:
    """Error of the model, its interval, and the errors of the baselines."""
    first, *others = numbers(at[key])
    return [first, interval(at.sel(model="model"), key), *others]


def _outside(validity: xr.Dataset) -> list[tuple[Any, str]]:
    """Tests outside the training, and why."""
    return [(run, why) for run, why in validity["outside"].to_series().items() if why]


def response_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return amplitude and phase against frequency, with the judgement by V&V 20."""
    measured, reference = checked.results.get("measured_response"), result.attrs["reference"]
    if "validation" in checked.refused:  # points beside the answer to something else
        measured = None
    per, words, tables = reference, [], []
    if "wave" in result["input"]:
        per = f"a wave that passes all probes, counted from {reference}"
    every = {*result["input"].values} - {"wave"}
    if others := ", ".join(sorted(name for name in every if not is_elevation(name, rates=True))):
        words.append(
            f"Besides the waves, inputs ({others}) are at their means in the response and decay of "
            "the model. In the measured ones they act, as a damper that is an input does."
        )
    unknown = result["amplitude"].isnull().all(["input", "frequency"])
    if read := ", ".join(map(str, result["state"].values[unknown])):
        words.append(f"{read}: read off other states, so that no linear response stands for it.")
    if measured:
        # Those of irregular waves stand in the figure.
        at = measured.sel(point=measured["kind"] == "regular")
        at = at.assign_coords(units=("state", result["units"].isel(input=-1).values))
        shown = _as_shown(at, "amplitude", "amplitude_uncertainty")
        tables.append(table("measured_response", entries(shown, "point", "state")))
        if "irregular" in measured["kind"]:
            words.append(
                "Points of irregular waves are of all runs, training included. Their bars hold "
                "chance, and the change from segments half as long, by which leakage is judged."
            )
    if "validation" in checked.results:
        tables.append(_validation_table(checked.results["validation"]))
    figure = drawing("response", checks.response, result, measured)
    return section("response", figure, *tables, per=per, more=words)


def _as_shown(result: xr.Dataset, *keys: str) -> xr.Dataset:
    """Some variables in the units that are shown, and ``shown``: each state with its unit."""
    chosen = result[[*keys]]
    values = chosen.to_array().transpose("state", ...).values
    factors, units = zip(*map(prefixed, result["units"].values, values), strict=True)
    names = [
        f"{state} [{shown_unit(unit)}]"
        for state, unit in zip(result["state"].values, units, strict=True)
    ]
    scaled = chosen * xr.DataArray([*factors], dims="state")
    return result.assign(scaled).assign_coords(shown=("state", names))


def _validation_table(result: xr.Dataset) -> Table:
    """E and u_val of each state: over the regular runs one by one, irregular points together."""
    shown = _as_shown(result.rename(uncertainty="error_uncertainty"), "error", "error_uncertainty")
    rows = []
    for own in entries(shown, "state"):
        for kind in ("regular", "irregular"):
            at = own.sel(point=(own["kind"] == kind) & np.isfinite(own["error"]))
            if at.sizes["point"]:
                beyond = abs(at["error"]) - at["error_uncertainty"]
                rms = np.sqrt((at["error"] ** 2).mean())
                sums = {"points": at.sizes["point"], "passed": at["within"].sum(), "rms": rms}
                rows.append(at.isel(point=beyond.argmax("point")).assign(sums))
    return table("validation", rows)


def possible_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return coherence, and the least error of a linear map beside the model's."""
    advice, unjudged = defaultdict(list), defaultdict(list)
    worth, segment = checked.results.get("worth"), result.attrs["segment"]
    ahead = worth is not None and bool((worth["look_ahead"] > 0).any())
    for state in result["state"].values:
        own = result.sel(state=state)
        if own["still"]:
            unjudged["it stands still in these runs"].append(state)
        elif own["period"] > segment / 3:
            why = (
                f"its slow period of {float(own['period']):.3g} s exceeds a third of a segment of "
                f"{segment:.3g} s"
            )
            unjudged[why].append(state)
        else:
            model, linear = float(own["nrmse"]), float(own["linear_bound"])
            more = float(own.get("observables_bound", np.nan))
            beside = f"{state}: model {model:.2g}, linear bound {linear:.2g}"
            beside += f", with the observables {more:.2g}" * bool(np.isfinite(more))
            turned = float(own["correlation"]) < TURNED
            advice[_advice(model, linear, more, ahead, turned)].append(beside)
    points = [f"{'; '.join(states)}. {words}" for words, states in advice.items()]
    points += [f"{', '.join(of)}: cannot be judged: {why}." for why, of in unjudged.items()]
    if worth and (state := worth.attrs["conditional_on"]):
        points.append(
            f"The inputs are carried by measured {state} and so hold part of it: with waves alone "
            f"the bounds of {state}, and of what follows it, are higher."
        )
    figure = drawing("coherence", checks.coherence, result)
    rows = table("possible", _beside_training(result, checked.results.get("training_coherence")))
    return section("coherence", figure, rows, points=points, **result.attrs)


def _beside_training(result: xr.Dataset, trained: xr.Dataset | None) -> Iterator[xr.Dataset]:
    """Each state of a result, and after it the same of training, where there is one."""
    for state in result["state"].values:
        for each in (result, trained):
            if each:
                yield each.sel(state=state).assign(of=each.attrs["of"])


def _advice(model: float, linear: float, more: float, ahead: bool, turned: bool) -> str:
    """What the distance of a model from its bounds says; `ahead`, whether it has a look-ahead."""
    if not np.isfinite(model):
        return "No free run holds over the test."
    if turned:
        return (
            "The forecast goes up where the measurement goes down: its sign looks turned over in "
            "these runs, or in those that trained. Check sign in [channels], and the files."
        )
    least = np.nanmin([linear, more])
    first = "" if ahead else "a look-ahead (waves measured up-wave), "
    if model < 0.95 * least:
        return "Better than any linear map of the inputs: no room is seen."
    if model < 1.15 * linear and not more < 0.85 * linear:
        return (
            "As good as a linear map of these inputs allows. What may help: "
            f"{first}observables, more probes or less noise."
        )
    if more < 0.85 * linear and model > 1.15 * more:
        return "Observables can tell more than any linear map, and there is room left."
    if model > 1.15 * least:
        return f"There is room. What may help: {first}more delays, another ridge, more training."
    return "As good as inputs and observables allow."


def decay_section(modes: xr.Dataset, checked: Checked) -> Section:
    """Return free decay, beside measured ones, and the modes."""
    words, points, decay, shown = [], [], None, None
    if result := checked.results.get("decay"):
        cells = partial(row, period=3, damping_ratio=3, p=3)
        rows = [
            (*cells(own, "motion", q=0), "model") for own in entries(result.assign(q=0), "motion")
        ]
        if measured := checked.results.get("measured_decay"):
            rows += [
                (*cells(at, "motion", q=3), *row(at, "run")) for at in entries(measured, "run")
            ]
        decay, shown = drawing("decay", checks.decay, result), table("decay", rows)
        most = abs(result["displacement"]).max("time", skipna=False)
        # None swings farther than it was moved in still water.
        points = [
            f"{motion}: after its release the model swings to {reach:.2g} times the offset, where "
            "a vessel in still water swings back by less than it was moved. Read no period and no "
            "damping off it: the state of this model follows the waves, or its delays fit noise."
            for motion, reach in most.to_series().items()
            if reach > OVERSHOOT
        ]
        words.append(
            "The model holds an offset for the length of its history, and is released. A motion "
            "with fewer than three extremes has neither period nor damping: it creeps back, or its "
            "forecast leans on the waves and forgets the state."
        )
    taken = []
    for own in entries(modes.head(mode=SLOWEST), "mode"):
        shares = own["participation"].to_series().nlargest(2)
        taking = ", ".join(f"{state} {part:.2f}" for state, part in shares.items())
        taken.append(own.assign(taking=taking))
    figure = drawing("modes", checks.modes, modes) if modes.sizes["state"] > 1 else None
    listed = table("modes", taken, shown=len(taken), modes=modes.sizes["mode"])
    return section("modes", decay, shown, figure, listed, more=words, points=points)


def residuals_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return whiteness, past inputs, bands and age of the errors."""
    lag, period = result["lag"].values, result.attrs["encounter_period"]
    rows = []
    for own in _beside_training(result, checked.results.get("training_residuals")):
        if "input_correlation" in own:
            own["beyond"] = (np.abs(own["input_correlation"]) > own["input_limit"]).mean()
        errors = (*own["band_nrmse"], *own["age_nrmse"][[own.sizes["lag"] - 2, -1]])
        names = ("slow", "wave", "above", "first", "last")
        rows.append(own.assign(dict(zip(names, errors, strict=True))))
    shown = table(
        "residuals",
        rows,
        oldest=result.sizes["age"] * (lag[1] - lag[0]) / period,
        lag=lag[-1],
        lags=lag.size - 1,
        instants=result.attrs["instants"],
        period=period,
    )
    return section(
        "residuals", drawing("residuals", checks.residuals, result), shown, **result.attrs
    )


def statistics_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return the statistics of responses that designers read."""
    extremes = [side + end for side in ("extreme", "trough") for end in ("", "_lower", "_upper")]
    shown = _as_shown(result, "mean", "significant_double_amplitude", *extremes)
    # A divergence is that of the forecast.
    shown["divergence"] = shown["divergence"].where(shown["kind"] == "forecast")
    points = [
        f"{at['state'].item()}: by the law fitted, fewer than 1 in 100 such records hold a "
        "deviation as large as the largest measured. The law does not hold for the largest, as "
        "where seas of several kinds are judged together."
        for at in entries(result.sel(kind="measured"), "state")
        if at["extreme_chance"] < RARE or at["trough_chance"] < RARE
    ]
    return section(
        "statistics",
        drawing("exceedance", checks.exceedance, result),
        drawing("density", checks.density, result),
        table(
            "statistics",
            entries(shown, "state", "kind"),
            of=result.attrs["of"],
            hours=result.attrs["duration"] / 3600,
        ),
        points=points,
    )


def validity_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return where each test lies against the training."""
    rows = (at for at in entries(result, "run", "part") if np.isfinite(at["height"]))
    points = [
        f"{run}: {why}. What the model says there is an extrapolation."
        for run, why in _outside(result)
    ] or ["All tests lie inside the waves that trained the model."]
    points += [
        f"{text[0].upper()}{text[1:]} This test shows memory, not skill."
        for text in checked.repeats.values()
    ]
    return section(
        "validity",
        drawing("validity", checks.validity, result),
        table("validity", rows),
        points=points,
    )


def drift_section(result: xr.Dataset, checked: Checked) -> Section:
    """Return the second order: mean drift and slow response per amplitude squared."""
    rows: list[xr.Dataset] = []
    if "offset" in result:
        shown = _as_shown(result, "slow_response", "offset", "offset_uncertainty")
        for own in entries(shown.dropna("state", how="all", subset=["slow_response"]), "state"):
            model = own["slow_response"][0].interp(frequency=own["point_frequency"])
            rows += entries(own.assign(model=model), "point")
    known = result.attrs
    figure = drawing("drift", checks.drift, result, **known)
    return section("drift", figure, table("drift", rows, **known), **known)


CHECK_SECTIONS = {
    worth_section: ("worth",),
    response_section: ("response", "measured_response", "validation"),
    possible_section: ("coherence",),
    decay_section: ("modes", "decay", "measured_decay"),
    residuals_section: ("residuals",),
    statistics_section: ("statistics",),
    validity_section: ("validity",),
    drift_section: ("drift",),
}
"""Sections, with the checks that each shows; it is made of the result of the first."""


def check_sections(checked: Checked) -> list[Section]:
    """Sections of the page; each says what could not be judged, and why."""
    out = []
    for make, needed in CHECK_SECTIONS.items():
        key = needed[0]
        result, title = checked.results.get(key), WORDS["sections"][key]["title"]
        built = Section(key, title) if result is None else make(result, checked)
        refused = [checked.refused[name] for name in needed if name in checked.refused]
        texts = [f"Cannot be judged: {text}" for text in dict.fromkeys(refused)]
        texts += dict.fromkeys(note for name in needed for note in checked.notes.get(name, ()))
        out.append(replace(built, notices=texts))
    return out
