"""The page of ``seakeep check``: what a model is worth, section by section."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.check import Checked
from seakeep.conventions import displayed
from seakeep.report.figures import checks
from seakeep.report.page import write_page
from seakeep.report.section import Drawing, Section
from seakeep.report.style import shown_unit
from seakeep.report.tables import MISSING, Table, interval, number, probability, text
from seakeep.report.worth import worth_section

__all__ = ["CHECK_SECTIONS", "check_sections", "write_check"]


OVERSHOOT = 1.1
"""Largest swing over the offset that a free decay may show; the rest is for the noise of a fit."""


def response_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return amplitude and phase against frequency, with the judgement by V&V 20."""
    measured = checked.found.get("measured_response")
    reference = found.attrs["reference"]
    wave = "wave" in found["input"]
    if "validation" in checked.refused:  # points beside the answer to something else
        measured = None
    counted = f"a wave that passes all probes, counted from {reference}" if wave else str(reference)
    read = [str(s) for s in found["state"].values if found["amplitude"].sel(state=s).isnull().all()]
    words = [
        f"The response amplitude operator (RAO): the response per amplitude of {counted}, from the "
        "matrices of the model: its answer to small "
        "waves. Bars are expanded uncertainties at 95 %.",
    ]
    if read:
        words.append(
            f"{', '.join(read)}: read off other states, so that no linear response stands for it."
        )
    if measured is not None and (measured["kind"] == "irregular").any():
        words.append(
            "Points of irregular waves are of all runs, training included. Their bars hold chance, "
            "and the change from segments half as long, by which leakage is judged."
        )
    drawing = Drawing(
        "response",
        "Amplitude (RAO) and phase of the response (phase positive where the vessel is early). "
        "Grey: the training input holds no energy there.",
        partial(checks.response, found, measured),
    )
    regular = measured is not None and (measured["kind"] == "regular").any()
    tables = [_points_table(measured, found)] if measured is not None and regular else []
    if "validation" in checked.found:
        tables.append(_validation_table(checked.found["validation"]))
    return Section("response", "Response (RAO)", words, figures=[drawing], tables=tables)


def _points_table(measured: xr.Dataset, found: xr.Dataset) -> Table:
    """Measured response in regular waves; irregular ones stand in the figure."""
    at = measured.isel(point=np.flatnonzero(measured["kind"].values == "regular"))
    at = at.assign_coords(units=("state", found["units"].isel(input=-1).values))
    rows = [
        (
            str(own["run"].values),
            number(own["frequency"]),
            number(own["wave_amplitude"], 4),
            state,
            _sure(own, "amplitude", factor),
            _sure(own, "phase"),
        )
        for point in range(at.sizes["point"])
        for own, factor, state in _states(at.isel(point=point))
    ]
    return Table(
        "measured_response",
        "Measured response in regular waves",
        ("run", "frequency [Hz]", "wave amplitude [m]", "state", "amplitude", "phase [°]"),
        rows,
        "± expanded uncertainty at 95 % by ITTC 7.5-02-07-02.1: scatter over windows of whole "
        "periods, and the accuracy of the instruments. Without a stated accuracy: scatter only.",
        (1, 2),
        folded=True,
    )


def _states(found: xr.Dataset) -> Iterator[tuple[xr.Dataset, float, str]]:
    """Results of each state, the factor to the unit that is shown, and its name with that unit."""
    for state, unit in zip(found["state"].values, found["units"].values, strict=True):
        factor, shown = displayed(str(unit))
        yield found.sel(state=state), factor, f"{state} [{shown_unit(shown)}]"


def _numbers(own: xr.Dataset, *keys: str, digits: int = 3) -> Iterator[str]:
    return (number(own[key], digits) for key in keys)


def _sure(own: xr.Dataset, key: str, factor: float = 1.0) -> str:
    """Value ± expanded uncertainty."""
    return text(factor * own[key], [factor * float(own[f"{key}_uncertainty"])])


def _validation_table(found: xr.Dataset) -> Table:
    """E and u_val of each state: over the regular runs one by one, irregular points together."""
    rows = []
    for own, factor, state in _states(found):
        for kind in ("regular", "irregular"):
            at = own.isel(point=np.flatnonzero(own["kind"].values == kind))
            known = np.isfinite(at["error"].values)
            if not known.any():
                continue
            error, sure = at["error"].values[known], at["uncertainty"].values[known]
            worst = int(np.argmax(np.abs(error) - sure))
            rows.append(
                (
                    state,
                    kind,
                    str(known.sum()),
                    str(int(at["within"].values[known].sum())),
                    text(factor * np.sqrt(np.mean(error**2)), digits=None),
                    number(at["frequency"].values[known][worst]),
                    text(factor * error[worst], [factor * sure[worst]]),
                )
            )
    columns = (
        *("state", "waves", "points", "|E| < U_val", "RMS of E", "worst at [Hz]"),
        "E ± U_val there",
    )
    return Table(
        "validation",
        "Judgement by ASME V&V 20: comparison error E = S − D of the amplitude",
        columns,
        rows,
        "Where |E| < U_val the error cannot be told from the uncertainty of the measurement and "
        "of an ensemble's members; elsewhere the model errs by about E.",
        (2, 3, 4, 5),
    )


def possible_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return coherence, and the least error of a linear map beside the model's."""
    rows, trained = [], checked.found.get("training_coherence")
    advice: dict[str, list[str]] = {}
    unjudged: dict[str, list[str]] = {}
    ahead = "worth" in checked.found and bool((checked.found["worth"]["look_ahead"] > 0).any())
    for state in map(str, found["state"].values):
        own = found.sel(state=state)
        rows += [
            _bounds_row(each.sel(state=state)) for each in (found, trained) if each is not None
        ]
        if bool(own["still"]):
            unjudged.setdefault("it stands still in these runs", []).append(state)
            continue
        if float(own["period"]) > found.attrs["segment"] / 3:
            why = (
                f"its slow period of {float(own['period']):.3g} s exceeds a third of a segment of "
                f"{found.attrs['segment']:.3g} s"
            )
            unjudged.setdefault(why, []).append(state)
            continue
        model, linear = float(own["nrmse"]), float(own["linear_bound"])
        more = float(own.get("observables_bound", np.nan))
        beside = f"{state}: model {model:.2g}, linear bound {linear:.2g}"
        if np.isfinite(more):
            beside += f", with the observables {more:.2g}"
        advice.setdefault(_advice(model, linear, more, ahead), []).append(beside)
    points = [f"{'; '.join(states)}. {words}" for words, states in advice.items()]
    points += [f"{', '.join(of)}: cannot be judged: {why}." for why, of in unjudged.items()]
    if "worth" in checked.found and (state := checked.found["worth"].attrs["conditional_on"]):
        points.append(
            f"The inputs are carried by measured {state} and so hold part of it: with waves alone "
            f"the bounds of {state}, and of what follows it, are higher."
        )
    return Section(
        "possible",
        "What is possible",
        words=[
            "The linear bound is the least error of a linear map of the inputs, by coherence in "
            f"{found.attrs['of']} in irregular waves ({found.attrs['averages']:.0f} segments of "
            f"{found.attrs['segment']:.3g} s). It is estimated from what linear models "
            "leave, which hardly leaks between frequencies, and lies above the error of none of "
            "them: the baselines, and this model if it is linear. With observables the model "
            "itself counts. Its error is that of free runs over the same instants."
        ],
        points=points,
        figures=[
            Drawing(
                "coherence",
                "Coherence of each state with the inputs, over the spectrum of the state.",
                partial(checks.coherence, found),
            )
        ],
        tables=[
            Table(
                "possible",
                "NRMSE of the model's free runs, and what the inputs allow",
                ("state", "of", "model", "linear bound", "95 %", "with observables", "95 % of it"),
                rows,
                "Bounds are corrected for what as many inputs explain of noise by chance; "
                "intervals are those of the part that is left. Training is shown as context.",
                (2, 3, 4, 5, 6),
                heat=(2, 3, 5),
            )
        ],
    )


def _bounds_row(own: xr.Dataset) -> tuple[str, ...]:
    """Error of a state, and its bounds with their intervals."""
    cells = []
    for key in ("linear_bound", "observables_bound"):
        cells += [number(own[key]), interval(own, key)] if key in own else [MISSING] * 2
    return (str(own["state"].values), own.attrs["of"], number(own["nrmse"]), *cells)


def _advice(model: float, linear: float, more: float, ahead: bool) -> str:
    """What the distance of a model from its bounds says; `ahead`, whether it has a look-ahead."""
    if not np.isfinite(model):
        return "No free run holds over the test."
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


def decay_section(table: xr.Dataset, checked: Checked) -> Section:
    """Return free decay, beside measured ones, and the modes."""
    figures, tables, words, points = [], [], [], []
    if (found := checked.found.get("decay")) is not None:
        keys = ("period", "damping_ratio", "p")
        rows = [
            (str(motion), *_numbers(found.sel(motion=motion), *keys), "0", "model")
            for motion in found["motion"].values
        ]
        if (measured := checked.found.get("measured_decay")) is not None:
            for run in measured["run"].values:
                own = measured.sel(run=run)
                rows.append((str(own["motion"].values), *_numbers(own, *keys, "q"), str(run)))
        columns = ("motion", "period [s]", "damping ratio", "p", "q [1/m or 1/rad]", "of")
        note = (
            "Decrement of a cycle p + q a. A linear model's does not depend on the amplitude a. A "
            "dash: fewer than three extremes, as where a motion creeps back."
        )
        tables.append(Table("decay", "Free decay", columns, rows, note, (1, 2, 3, 4)))
        caption = "What is left of an offset of one training SD after its release in still water."
        figures.append(Drawing("decay", caption, partial(checks.decay, found)))
        points = _ringing(found)
        words.append(
            "The model holds an offset for the length of its history, and is released. A motion "
            "with fewer than three extremes has neither period nor damping: it creeps back, or its "
            "forecast leans on the waves and forgets the state."
        )
    if table.sizes["state"] > 1:
        caption = "Modes that decay slowest: states that take part in each (parts of one)."
        figures.append(Drawing("modes", caption, partial(checks.modes, table)))
    tables.append(_modes_table(table))
    return Section("decay", "Free decay and modes", words, points, figures=figures, tables=tables)


def _ringing(found: xr.Dataset) -> list[str]:
    """Motions that swing farther than they were moved, which none does in still water."""
    most = np.abs(found["displacement"].values).max(axis=1)
    return [
        f"{motion}: after its release the model swings to {reach:.2g} times the offset, "
        "where a vessel in still water swings back by less than it was moved. Read no period and "
        "no damping off it: the state of this model follows the waves, or its delays fit noise."
        for motion, reach in zip(found["motion"].values, most, strict=True)
        if reach > OVERSHOOT
    ]


def _modes_table(found: xr.Dataset) -> Table:
    rows = []
    for k in range(found.sizes["mode"]):
        own = found.isel(mode=k)
        largest = own["participation"].values.argsort()[::-1][:2]
        parts = ", ".join(
            f"{own['state'].values[at]} {float(own['participation'][at]):.2f}" for at in largest
        )
        keys = ("period", "damping_ratio", "decay_time", "modulus")
        rows.append((*_numbers(own, *keys, digits=4), parts))
    columns = ("period [s]", "damping ratio", "decay time [s]", "modulus", "states that take part")
    title = f"All {found.sizes['mode']} modes"
    return Table("modes", title, columns, rows, "", (0, 1, 2, 3), folded=True)


def residuals_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return whiteness, past inputs, bands and age of the errors."""
    lag, trained = float(found["lag"][-1]), checked.found.get("training_residuals")
    rows = [
        _residuals_row(each.sel(state=state))
        for state in found["state"].values
        for each in (found, trained)
        if each is not None
    ]
    period = float(found.attrs["encounter_period"])
    step = float(found["lag"][1] - found["lag"][0])
    columns = (
        *("state", "of", "one step [SD]", "Ljung–Box Q", "p", "past inputs beyond limit"),
        *("slow", "wave", "above", "after 1 T"),
        f"after {found.sizes['age'] * step / period:.0f} T",
    )
    table = Table(
        "residuals",
        "Errors of one step, and of free runs by band and age (in measured SDs)",
        columns,
        rows,
        f"Ljung–Box up to a lag of {lag:.3g} s ({found.sizes['lag'] - 1} samples) over "
        f"{found.attrs['instants']} instants; p is the probability of white noise. Of white "
        "residuals 5 % of the lags lie beyond the limit. Bands: below 0.5, to 2, and above 2 "
        f"cycles per encounter period ({period:.3g} s).",
        range(2, len(columns)),
        heat=(6, 7, 8, 9, 10),
    )
    caption = (
        "Per state: autocorrelation of one-step errors and their correlation with past inputs "
        "(grey: 95 % limits), spectrum of the error of free runs over that of the measurement, and "
        "error against the age of the forecast."
    )
    drawing = Drawing("residuals", caption, partial(checks.residuals, found))
    words = [
        "A model that has taken all from the data leaves one-step errors that are white and know "
        "nothing of past inputs. With long records even small errors fail this test: read it with "
        f"the size of the error. The figure is of the {found.attrs['of']}; the table also shows "
        "training, as context. Errors by age start at other instants than the free runs of the "
        "first section, and so differ from them."
    ]
    return Section("residuals", "Residuals", words, figures=[drawing], tables=[table])


def _residuals_row(own: xr.Dataset) -> tuple[str, ...]:
    beyond = np.nan
    if "input_correlation" in own:
        beyond = 100 * float((np.abs(own["input_correlation"]) > own["input_limit"]).mean())
    return (
        str(own["state"].values),
        own.attrs["of"],
        number(own["one_step"], 4),
        f"{float(own['ljung_box']):.0f}",
        probability(own["probability"]),
        f"{beyond:.0f} %" if np.isfinite(beyond) else MISSING,
        *map(number, own["band_nrmse"]),
        *(number(own["age_nrmse"][at]) for at in (own.sizes["lag"] - 2, -1)),
    )


def statistics_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return the statistics of responses that designers read."""
    rows = []
    for of_state, factor, state in _states(found):
        for kind in found["kind"].values:
            own = of_state.sel(kind=kind)
            bounds = [factor * float(own[f"extreme_{each}"]) for each in ("lower", "upper")]
            extreme = factor * own["extreme"] if np.isfinite(bounds[0]) else np.nan
            rows.append(
                (
                    state,
                    str(kind),
                    f"{factor * float(own['significant_double_amplitude']):.4g}",
                    number(own["zero_crossing_period"], 3),
                    f"{int(own['peaks'])}",
                    number(own["weibull_shape"], 2),
                    text(extreme, digits=None),
                    text(np.nan, bounds, digits=None),
                    number(own["divergence"], 4) if kind == "forecast" else MISSING,
                )
            )
    hours = float(found.attrs["duration"]) / 3600
    columns = (
        *("state", "of", "significant double amplitude", "zero-crossing period [s]", "peaks"),
        *("Weibull shape", "extreme", "95 % of it", "JSD"),
    )
    table = Table(
        "statistics",
        f"Statistics of responses over the {found.attrs['of']} in irregular waves",
        columns,
        rows,
        f"Extreme: most probable largest deviation from the mean in {hours:.3g} h of "
        "these records' time (3 h at full scale), by Weibull's law; its interval is what the fit "
        "does not know. Rayleigh's law has the shape 2. JSD: Jensen–Shannon divergence of the "
        "densities forecast and measured (0 to 0.69), of deviations from the mean: no offset is "
        "seen. Peaks of slow channels mix slow and wave motion.",
        range(2, len(columns)),
    )
    caption = (
        "How often a peak exceeds a level, measured and forecast, beside Rayleigh and Weibull."
    )
    drawings = [
        Drawing("exceedance", caption, partial(checks.exceedance, found)),
        Drawing("density", "Densities of the states.", partial(checks.density, found)),
    ]
    return Section("statistics", "Statistics of responses", figures=drawings, tables=[table])


def validity_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return where each test lies against the training."""
    rows = []
    for run in found["run"].values:
        for part in found["part"].values:
            at = found.sel(run=run, part=part)
            if np.isfinite(at["height"]):
                keys = (("height", 3), ("period", 2), ("steepness", 4), ("drift", 3))
                cells = (number(at[key], digits) for key, digits in keys)
                rows.append((str(run), str(part), str(at["waves"].values), *cells))
    columns = ("run", "part", "waves", "height [m]", "period [s]", "steepness", "mean surge [m]")
    note = (
        "Steepness here is height over wave length in the depth of the run. Reasons judge "
        "steepness in deep water, by spectral mean period, so that their figures differ a little."
    )
    repeats = [
        f"{text[0].upper()}{text[1:]} This test shows memory, not skill."
        for text in checked.repeats.values()
    ]
    outside = [
        f"{run}: {text}. What the model says there is an extrapolation."
        for run, text in zip(found["run"].values, found["outside"].values, strict=True)
        if text
    ]
    caption = (
        "Waves (and mean surge) that trained the model, and those of each test. A test is outside "
        "where most of its energy lies at periods without energy in training, or where its height "
        "or steepness is beyond the largest of training by a tenth and the scatter of so short a "
        "record."
    )
    points = (outside or ["All tests lie inside the waves that trained the model."]) + repeats
    drawing = Drawing("validity", caption, partial(checks.validity, found))
    table = Table("validity", "Waves", columns, rows, note, (3, 4, 5, 6))
    return Section("validity", "Validity", points=points, figures=[drawing], tables=[table])


def drift_section(found: xr.Dataset, checked: Checked) -> Section:
    """Return the second order: mean drift and slow response per amplitude squared."""
    rows = []
    for own, factor, state in _states(found):
        if "offset" not in own or not np.isfinite(own["slow_response"]).any():
            continue
        mean = factor * own["slow_response"][0]
        for point in range(own.sizes["point"]):
            at = own.isel(point=point)
            f = float(at["point_frequency"])
            made = np.interp(f, mean["frequency"], mean, left=np.nan, right=np.nan)
            sure = _sure(at, "offset", factor)
            rows.append((state, str(at["run"].values), number(f), number(made, 4), sure))
    columns = ("state", "run", "frequency [Hz]", "model", "measured")
    note = (
        "Offset from the rest in still water, as the model has it, over the wave amplitude "
        "squared; ± expanded uncertainty at 95 % of the measured mean."
    )
    title = "Mean offset in regular waves, per amplitude squared"
    tables = [Table("drift", title, columns, rows, note, (2, 3, 4))] if rows else []
    words = [
        "What the observables make of one wave (the mean) and of two whose frequencies differ (a "
        "slow response at the difference, half of it per amplitude squared, so that it tends to "
        f"the mean), probed with an amplitude of {float(found.attrs['amplitude']):.3g} m."
    ]
    caption = (
        "Mean and slow response per wave amplitude squared, against the frequency of the wave."
    )
    drawing = Drawing("drift", caption, partial(checks.drift, found))
    return Section("second-order", "Second order", words, figures=[drawing], tables=tables)


CHECK_SECTIONS: list[tuple[str, Sequence[str], Callable[[xr.Dataset, Checked], Section]]] = [
    ("What the model is worth", ("worth",), worth_section),
    ("Response (RAO)", ("response", "measured_response", "validation"), response_section),
    ("What is possible", ("coherence",), possible_section),
    ("Free decay and modes", ("modes", "decay", "measured_decay"), decay_section),
    ("Residuals", ("residuals",), residuals_section),
    ("Statistics of responses", ("statistics",), statistics_section),
    ("Validity", ("validity",), validity_section),
    ("Second order", ("drift",), drift_section),
]
"""Title, the checks that it shows, and what makes it of the result of the first."""


def check_sections(checked: Checked) -> list[Section]:
    """Sections of the page; each says what could not be judged, and why."""
    out = []
    for title, needed, make in CHECK_SECTIONS:
        found = checked.found.get(needed[0])
        made = Section(needed[0], title) if found is None else make(found, checked)
        refused = [checked.refused[name] for name in needed if name in checked.refused]
        told = [f"Cannot be judged: {text}" for text in dict.fromkeys(refused)]
        told += dict.fromkeys(note for name in needed for note in checked.notes.get(name, ()))
        out.append(replace(made, notices=(*made.notices, *told)))
    return out


def write_check(checked: Checked, folder: Path, title: str, description: str) -> Path:
    """Write ``report.html`` with ``figures/`` and ``tables/`` into a folder; return the page."""
    stamp = {"description": description, "finished": ""}
    return write_page(folder, title, stamp, check_sections(checked))
