"""The page of ``seakeep check``: what a model is worth, section by section."""

from __future__ import annotations

from collections.abc import Callable
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
from seakeep.report.tables import Table, number

__all__ = ["CHECK_SECTIONS", "check_sections", "write_check"]


def response_section(checked: Checked) -> Section | None:
    """Return amplitude and phase against frequency, with the judgement by V&V 20."""
    found, measured = (checked.found.get(key) for key in ("response", "measured_response"))
    if found is None:
        return None
    reference = found.attrs["reference"]
    wave = "wave" in found["input"]
    counted = f"a wave that passes all probes, counted from {reference}" if wave else str(reference)
    read = [str(s) for s in found["state"].values if found["amplitude"].sel(state=s).isnull().all()]
    words = [
        f"Response per amplitude of {counted}, from the matrices of the model: its answer to small "
        "waves. Bars are expanded uncertainties at 95 %.",
    ]
    if read:
        words.append(
            f"{', '.join(read)}: read off other states, so that no linear response stands for it."
        )
    drawing = Drawing(
        "response",
        "Amplitude and phase of the response (phase positive where the vessel is early). Grey: "
        "the training input holds no energy there.",
        partial(checks.response, found, measured),
    )
    tables = [] if measured is None else [_points_table(measured, found)]
    if "validation" in checked.found:
        tables.append(_validation_table(checked.found["validation"]))
    return Section("response", "Response", tuple(words), figures=(drawing,), tables=tuple(tables))


def _points_table(measured: xr.Dataset, found: xr.Dataset) -> Table:
    """Measured response in regular waves; irregular ones stand in the figure."""
    at = measured.isel(point=np.flatnonzero(measured["kind"].values == "regular"))
    units = found["units"].isel(input=-1).values
    rows = []
    for point in range(at.sizes["point"]):
        one = at.isel(point=point)
        for state, unit in zip(one["state"].values, units, strict=True):
            own = one.sel(state=state)
            factor, shown = displayed(str(unit))
            rows.append(
                (
                    str(one["run"].values),
                    number(float(one["frequency"])),
                    number(float(one["wave_amplitude"]), 4),
                    f"{state} [{shown_unit(shown)}]",
                    _with_sure(factor * own["amplitude"], factor * own["amplitude_uncertainty"]),
                    _with_sure(own["phase"], own["phase_uncertainty"], 3),
                )
            )
    columns = ("run", "frequency [Hz]", "wave amplitude [m]", "state", "amplitude", "phase [°]")
    return Table(
        "measured_response",
        "Measured response in regular waves",
        columns,
        tuple(rows),
        "± expanded uncertainty at 95 % by ITTC 7.5-02-07-02.1: scatter over windows of whole "
        "periods, and the accuracy of the instruments where the campaign states it.",
        (1, 2),
        folded=True,
    )


def _with_sure(value: xr.DataArray, sure: xr.DataArray, most: int = 6) -> str:
    """Value ± uncertainty, the latter with two digits."""
    x, u = float(value), float(sure)
    if not (np.isfinite(x) and np.isfinite(u)):
        return number(np.nan)
    digits = min(most, max(0, 1 - int(np.floor(np.log10(u))))) if u > 0 else most
    return f"{x:.{digits}f} ± {u:.{digits}f}"


def _validation_table(found: xr.Dataset) -> Table:
    """E and u_val of each state: over the regular runs one by one, irregular points together."""
    rows = []
    for state, unit in zip(found["state"].values, found["units"].values, strict=True):
        factor, shown = displayed(str(unit))
        own = found.sel(state=state)
        for kind in ("regular", "irregular"):
            at = own.isel(point=np.flatnonzero(own["kind"].values == kind))
            known = np.isfinite(at["error"].values)
            if not known.any():
                continue
            error, sure = at["error"].values[known], at["uncertainty"].values[known]
            worst = int(np.argmax(np.abs(error) - sure))
            rows.append(
                (
                    f"{state} [{shown_unit(shown)}]",
                    kind,
                    str(known.sum()),
                    str(int(at["within"].values[known].sum())),
                    number(factor * float(np.sqrt(np.mean(error**2))), 4),
                    number(float(at["frequency"].values[known][worst])),
                    f"{number(factor * error[worst], 4)} against {number(factor * sure[worst], 4)}",
                )
            )
    columns = (
        *("state", "waves", "points", "|E| < U_val", "RMS of E", "worst at [Hz]"),
        "E against U_val there",
    )
    return Table(
        "validation",
        "Judgement by ASME V&V 20: comparison error E = S − D of the amplitude",
        columns,
        tuple(rows),
        "Where |E| < U_val the error cannot be told from the uncertainty of the measurement and "
        "of an ensemble's members; elsewhere the model errs by about E.",
        (2, 3, 4, 5),
    )


def possible_section(checked: Checked) -> Section | None:
    """Return coherence, and the least error of a linear map beside the model's."""
    found = checked.found.get("coherence")
    if found is None:
        return None
    rows, advice = [], []
    for state in map(str, found["state"].values):
        own = found.sel(state=state)
        model, linear = float(own["nrmse"]), float(own["linear_bound"])
        more = float(own.get("observables_bound", np.nan))
        rows.append((state, number(model), number(linear), number(more)))
        text = f"{state}: model {model:.2g}, linear bound {linear:.2g}"
        if np.isfinite(more):
            text += f", with the observables {more:.2g}"
        advice.append(f"{text}. {_advice(model, linear, more)}")
    return Section(
        "possible",
        "What is possible",
        words=(
            "No linear map of the inputs errs by less than the linear bound, from the coherence of "
            f"the runs in irregular waves ({found.attrs['averages']:.0f} independent segments of "
            f"{found.attrs['segment']:.3g} s). Motions slower than a segment are not resolved: "
            "there the bound is too high, and a model that continues the measured state may lie "
            "below it.",
        ),
        points=tuple(advice),
        figures=(
            Drawing(
                "coherence",
                "Coherence of each state with the inputs, over the spectrum of the state.",
                partial(checks.coherence, found),
            ),
        ),
        tables=(
            Table(
                "possible",
                "NRMSE of the model's free runs, and what the inputs allow",
                ("state", "model", "linear bound", "with observables"),
                tuple(rows),
                "Bounds are corrected for what as many inputs explain of noise by chance.",
                (1, 2, 3),
                heat=(1, 2, 3),
            ),
        ),
    )


def _advice(model: float, linear: float, more: float) -> str:
    """What the distance of a model from its bounds says."""
    if not np.isfinite(model):
        return "No free run holds over the test."
    least = np.nanmin([linear, more])
    if model < 0.95 * least:
        return "The model continues slow motion that the segments do not resolve."
    if model < 1.15 * linear and not more < 0.85 * linear:
        return "As good as the inputs allow: more probes or less noise would help, not more tuning."
    if more < 0.85 * linear and model > 1.15 * more:
        return "Observables can tell more than any linear map, and there is room left."
    if model > 1.15 * least:
        return "There is room: more delays, another ridge or more training may help."
    return "As good as inputs and observables allow."


CHECK_SECTIONS: list[tuple[str, tuple[str, ...], Callable[[Checked], Section | None]]] = [
    ("Response", ("response", "measured_response", "validation"), response_section),
    ("What is possible", ("coherence",), possible_section),
]
"""Title, the checks that it shows, and what makes it."""


def check_sections(checked: Checked) -> list[Section]:
    """Sections of the page; each says what could not be judged, and why."""
    out = []
    for title, needed, make in CHECK_SECTIONS:
        made = make(checked) or Section(needed[0], title)
        refused = [checked.refused[name] for name in needed if name in checked.refused]
        told = [f"Cannot be judged: {text}" for text in dict.fromkeys(refused)]
        told += dict.fromkeys(note for name in needed for note in checked.notes.get(name, ()))
        out.append(replace(made, notices=made.notices + tuple(told)))
    return out


def write_check(checked: Checked, folder: Path, title: str, description: str) -> Path:
    """Write ``report.html`` with ``figures/`` and ``tables/`` into a folder; return the page."""
    stamp = {"description": description, "finished": ""}
    return write_page(folder, title, stamp, check_sections(checked))
