"""Models in service: skill against lead time, where waves to come are not known."""

from __future__ import annotations

from functools import partial

from seakeep.report.nowcast import nowcast_blocks, nowcast_figure
from seakeep.report.section import Drawing, Section
from seakeep.study import StudyResult

__all__ = ["service"]


def service(result: StudyResult) -> Section | None:
    """Return errors against lead time of models that were judged in service."""
    groups = {model: result.groups.get(f"nowcast/{model}") for model in result.models}
    found = {model: each for model, each in groups.items() if each is not None}
    if not found:
        return None
    first = next(iter(found.values()))
    runs = [str(name) for name in first["run"].values]
    figures = [
        Drawing(
            f"nowcast_{run}",
            f"{run}: root mean square error in service against lead time, and what the model "
            f"claims of it, over {int(first.attrs['starts'])} forecasts.",
            partial(nowcast_figure, found, run),
        )
        for run in runs
    ]
    words = (
        "Models of the first training set, played sample by sample. Waves after a start are "
        "predicted from what the probes have measured until then."
    )
    return Section(
        "service",
        "In service",
        (words,),
        figures=tuple(figures),
        tables=tuple(nowcast_blocks(found)),
    )
