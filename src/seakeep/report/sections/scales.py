"""Errors in SD of the window beside the same errors in SD of the training."""

from __future__ import annotations

from seakeep.report.figures.common import model_words
from seakeep.report.section import Section
from seakeep.report.sections.summary import conditional
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult

__all__ = ["scales"]


def scales(result: StudyResult) -> Section:
    """Return errors counted in both standard deviations."""
    words = (
        "A window may hold little of a channel's motion: in regular waves drift stands still, at a "
        "mean far from that of the training, and an error that is small beside the motions of the "
        "training is many SD of the window."
    )
    tables = tuple(_table(result, test) for test in result.tests)
    return Section("scales", "Errors in SD of the training", words=(words,), tables=tables)


def _table(result: StudyResult, test: str) -> Table:
    data = result.tests[test]
    median = result.groups["statistics/boxes"]["median"].sel(test=test)
    spread = data["measured"].std("time", ddof=1) / data["training_std"]
    size = spread.where(data["judged"]).median(["training", "window"])
    rows = []
    for name in [*result.channels, "average"]:
        part = "" if name == "average" else number(size.sel(channel=name), 2)
        cells = []
        for model in result.models:
            at = median.sel(model=model, channel=name)
            window, training = (number(at.sel(measure=key)) for key in ("nrmse", "training_nrmse"))
            cells.append(f"{window} ({training})")
        rows.append((name if name == "average" else result.words_of(name), part, *cells))
    return Table(
        f"scales_{test}",
        f"Errors in SD of the window, and in SD of the training, {result.label_of(test)}",
        ("channel", "SD of the window [training SD]", *map(model_words, result.models)),
        rows,
        "Medians over the cells of the root mean square error, in SD of the window, and in "
        "parentheses in SD of the training set. A channel that barely moves in the window is not "
        "judged in the first, and counts in the second." + conditional(result),
        range(1, 2 + len(result.models)),
        averages=[len(rows) - 1],
        folded=test != next(iter(result.tests)),
    )
