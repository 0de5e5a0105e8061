"""Sections of a study's report: each is a function of the result; here is their order."""

from __future__ import annotations

from collections.abc import Callable

from seakeep.report.section import Section
from seakeep.report.sections import (
    data,
    errors,
    histories,
    judgements,
    settings,
    summary,
)
from seakeep.study import StudyResult

__all__ = ["SECTIONS"]

SECTIONS: list[Callable[[StudyResult], Section | None]] = [
    summary.summary,
    errors.errors,
    errors.scales,
    errors.regular,
    histories.explorer,
    histories.histories,
    judgements.age,
    judgements.coverage,
    errors.bands,
    judgements.service,
    judgements.densities,
    judgements.members,
    data.waves,
    data.data,
    settings.chosen,
    settings.settings,
    settings.versions,
    summary.glossary,
]
"""A section is one function here; where it has nothing to show it returns None."""
