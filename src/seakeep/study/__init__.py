"""From campaign to judgement: which runs train which model, and how forecasts are compared."""

from seakeep.study.comparison import (
    Comparison,
    at_full_scale,
    compare,
    comparison_table,
    forecast_at_full_scale,
    in_degrees,
    with_degrees,
)
from seakeep.study.run import run_study
from seakeep.study.settings import Study, StudySettings, read_study
from seakeep.study.specs import build_spec
from seakeep.study.store import StorageError, StudyResult, read_result
from seakeep.study.workflow import fit_campaign, training_runs

__all__ = [
    "Comparison",
    "StorageError",
    "Study",
    "StudyResult",
    "StudySettings",
    "at_full_scale",
    "build_spec",
    "compare",
    "comparison_table",
    "fit_campaign",
    "forecast_at_full_scale",
    "in_degrees",
    "read_result",
    "read_study",
    "run_study",
    "training_runs",
    "with_degrees",
]
