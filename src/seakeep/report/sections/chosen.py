"""How settings were chosen on each training set, and how far each model looks ahead."""

from __future__ import annotations

from seakeep.report.figures.common import model_words
from seakeep.report.section import Section
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult

__all__ = ["chosen"]


def chosen(result: StudyResult) -> Section | None:
    """Return how settings were chosen; None where all are stated and no model looks ahead."""
    rows = []
    for model in result.models:
        data = result.groups["chosen"].sel(model=model)
        for name, text, ahead in zip(
            data["training"].values, data["words"].values, data["look_ahead"].values, strict=True
        ):
            if text or ahead > 0:
                note, *tried = str(text).splitlines() or ["stated"]
                words = "; ".join([note, *map(str.strip, tried)])
                rows.append((model_words(model), str(name), number(ahead, 2), words))
    if not rows:
        return None
    words = (
        "Settings that are not stated are chosen by free runs on training runs that are held out "
        "in turn; test windows are never looked at. Mean error with its 95 % interval and the best "
        "λ of each choice: what an observable is worth is the error of the choice without it. The "
        "look-ahead is how long after the instant that is forecast the last wave that is read lies."
    )
    table = Table(
        "chosen",
        "Choices and look-ahead",
        ("model", "training set", "look-ahead [s]", "chosen"),
        rows,
        numeric=(2,),
    )
    return Section("chosen", "How settings were chosen", words=(words,), tables=(table,))
