"""Samples that the greediest model or draw of a study asks for."""

from __future__ import annotations

from collections.abc import Sequence

from seakeep.models import HankelDMDc
from seakeep.models.settings import periods_to_samples
from seakeep.study.specs import Spec
from seakeep.study.windows import Needs

__all__ = ["needs_of"]


def needs_of(specs: Sequence[Spec], dt: float) -> Needs:
    """Samples of the greediest of several models.

    Parameters
    ----------
    specs : sequence of HankelDMDc or BayesianHankelDMDc
        Models; of an ensemble the upper ends of its priors count.
    dt : float
        Time step, s.

    Returns
    -------
    Needs
        The same windows then serve all models and all draws.
    """
    windows, histories = [1], [0]
    for spec in specs:
        if isinstance(spec, HankelDMDc):
            windows.append(spec.window or 1)
            histories.append(spec.history_samples - 1)
            continue

        def samples(prior: object, period: float = spec.encounter_period) -> int:
            # The last quantile of a prior without an upper end is its 1 − 1e-6 quantile.
            top = float(prior.ppf(1.0))  # type: ignore[attr-defined]
            if top == float("inf"):
                top = float(prior.ppf(1.0 - 1e-6))  # type: ignore[attr-defined]
            return periods_to_samples(top, period, dt)

        windows.append(1 if spec.train_length is None else samples(spec.train_length))
        histories.append(max(samples(spec.state_delay), samples(spec.input_delay)))
    inside = all(spec.history == "inside" for spec in specs)
    return Needs(max(windows), max(histories), inside)
