"""Checks of a model: worth, response, coherence, modes, residuals, statistics and validity.

:func:`check_model` makes all of them on the runs of a campaign.
"""

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from inspect import signature

import xarray as xr

from seakeep.arrays import Datasets, Groups, Progress
from seakeep.check.motion import decay, drift, measured_decay, modes
from seakeep.check.parts import Known, of_part
from seakeep.check.peaks import statistics
from seakeep.check.residuals import coherence, residuals
from seakeep.check.response import measured_response, response, validation
from seakeep.check.worth import validity, worth
from seakeep.errors import SeakeepError, SeakeepWarning, quiet
from seakeep.models import Model
from seakeep.models.labelled import check_channels

__all__ = [
    "CHECKS",
    "Checked",
    "check_model",
    "coherence",
    "decay",
    "drift",
    "measured_decay",
    "measured_response",
    "modes",
    "residuals",
    "response",
    "statistics",
    "validation",
    "validity",
    "worth",
]

CHECKS: dict[str, Callable[..., xr.Dataset]] = {
    each.__name__: each
    for each in (
        worth,
        response,
        measured_response,
        validation,
        coherence,
        decay,
        measured_decay,
        modes,
        residuals,
        statistics,
        validity,
        drift,
    )
}
"""Checks by name: of what there is, each takes what its parameters are called.

The first makes free runs that start where the baselines can be forecast too.
There are a `model` and prepared `runs` by name, and what checks share: `free` runs of model and
`baselines`, and the `measured` response.
"""


@dataclass(frozen=True, eq=False)
class Checked:
    """Results of the checks.

    Parameters
    ----------
    results : dict of str to Dataset
        Result of each check that could judge; where runs test, also ``training_coherence`` and
        ``training_residuals``, the same of what trains.
    refused : dict of str to str
        Why each other one could not.
    notes : dict of str to tuple of str
        Warnings of each.
    repeats : dict of str to str, optional
        Tests whose input repeats training input, in words.
    """

    results: Groups
    refused: dict[str, str]
    notes: dict[str, tuple[str, ...]]
    repeats: dict[str, str] = field(default_factory=dict)


def check_model(
    model: Model,
    runs: Datasets,
    progress: Progress | None = None,
    baselines: Mapping[str, Model] | None = None,
) -> Checked:
    """Check a model on prepared runs.

    Parameters
    ----------
    model : Model
        The model.
    runs : mapping of str to Dataset
        Prepared runs by name, as ``campaign.prepare()`` gives them.
    progress : callable, optional
        Called as ``progress(done, total, check)``.
    baselines : mapping of str to Model, optional
        Linear models of the same states, from :func:`seakeep.study.fit_baselines`, to compare with.

    Returns
    -------
    Checked

    Raises
    ------
    RequestError
        If a run lacks a channel of the model.
    """
    for name, run in runs.items():
        check_channels(run, [*model.states, *model.inputs], name)
    results: Groups = {}
    refused, notes = {}, {}
    given = {"model": model, "runs": runs, "free": {}, "baselines": baselines}
    for number, (name, check) in enumerate(CHECKS.items()):
        if progress is not None:
            progress(number, len(CHECKS), name)
        how = {key: given[key] for key in signature(check).parameters if key in given}
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                results[name] = check(**how)
            except SeakeepError as error:
                refused[name] = str(error)
        if name == "measured_response":
            given["measured"] = results.get(name)
        ours = [str(each.message) for each in caught if issubclass(each.category, SeakeepWarning)]
        notes[name] = tuple(dict.fromkeys(ours))
    trained = of_part(runs, "train")
    if trained and of_part(runs, "test"):
        free: Known = {}
        for name in ("coherence", "residuals"):
            with quiet(), suppress(SeakeepError):
                results[f"training_{name}"] = CHECKS[name](model, trained, free=free)
    return Checked(results, refused, notes)
