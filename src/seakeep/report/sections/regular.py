"""Regular waves: what of the error is amplitude, what phase, and what offset."""

from __future__ import annotations

import numpy as np

from seakeep.report.figures.common import judged_models, model_words
from seakeep.report.section import Section
from seakeep.report.sections.summary import conditional
from seakeep.report.tables import Table, number, signed
from seakeep.study import StudyResult

__all__ = ["regular", "response_table"]

SELDOM = 0.01
"""Part of a run's samples below which a slack line is not worth a word."""


def regular(result: StudyResult) -> Section | None:
    """Return the errors in regular waves, taken apart."""
    if "statistics/response" not in result.groups:
        return None
    tests = [str(test) for test in result.groups["statistics/response"]["test"].values]
    return Section(
        "regular",
        "Regular waves: where the error comes from",
        words=tuple(filter(None, (_slack_words(result, tests),))),
        tables=(response_table(result, tests),),
    )


def response_table(result: StudyResult, tests: list[str]) -> Table:
    """Amplitude ratio, phase lead and offset of each channel, test set by test set."""
    rows, columns = [], ["channel", "model"]
    for test in tests:
        label = result.label_of(test).removeprefix("regular, ")
        columns += [f"{label}: {key}" for key in ("amplitude", "phase [°]", "offset [SD]", "share")]
    for name in result.channels:
        for model in judged_models(result):
            row = [result.words_of(name), model_words(model)]
            for test in tests:
                at = result.groups["statistics/response"].sel(test=test, channel=name, model=model)
                parts = [float(at[f"error_{key}"]) for key in ("offset", "wave", "rest")]
                total = float(np.sum(np.square(parts)))
                share = 100 * parts[0] ** 2 / total if total > 0 else np.nan
                row += [
                    number(at["amplitude_ratio"], 2),
                    signed(at["phase_lead"], 0),
                    number(parts[0], 2),
                    f"{number(share, 0)} %" if np.isfinite(share) else number(share),
                ]
            rows.append(tuple(row))
    return Table(
        "response",
        "Forecast against measurement at the wave's frequency",
        columns,
        rows,
        "Amplitude: ratio of forecast to measurement; phase: positive where the forecast is early; "
        "offset: root mean square over the cells of the difference of means, in measured SDs; "
        "share: the offset's part of the mean square error." + conditional(result),
        range(2, len(columns)),
    )


def _slack_words(result: StudyResult, tests: list[str]) -> str:
    """Name the lines that lose their load, run by run."""
    tested = {str(run): test for test in tests for run in result.tests[test]["run"].values}
    slack = result.groups["runs"]["slack"].sel(run=list(tested), name=result.channels)
    listed = [
        f"{result.words_of(str(name))} in {100 * float(part):.0f} % of {run}"
        for run in tested
        for name, part in zip(slack["name"].values, slack.sel(run=run).values, strict=True)
        if part >= SELDOM
    ]
    if not listed:
        return ""
    return (
        f"Slack line (a load within the SD of its noise): {', '.join(listed)}. A slack line does "
        "not respond linearly; where it is slack throughout, only noise is left to be forecast."
    )
