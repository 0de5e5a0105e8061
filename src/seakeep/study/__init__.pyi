from .comparison import (
    Comparison,
    at_full_scale,
    compare,
    compare_models,
    comparison_table,
    difference_table,
    in_degrees,
    nowcast,
    nowcasts,
    to_full_scale,
    with_degrees,
)
from .fit import fit_baselines, fit_campaign, training_runs
from .run import run_study
from .settings import Study, StudySettings, read_study
from .store import StorageError, StudyResult, read_result

__all__ = [
    "Comparison",
    "StorageError",
    "Study",
    "StudyResult",
    "StudySettings",
    "at_full_scale",
    "compare",
    "compare_models",
    "comparison_table",
    "difference_table",
    "fit_baselines",
    "fit_campaign",
    "in_degrees",
    "nowcast",
    "nowcasts",
    "read_result",
    "read_study",
    "run_study",
    "to_full_scale",
    "training_runs",
    "with_degrees",
]
