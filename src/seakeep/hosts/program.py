"""What a model computes in one step, for any host: sizes, coefficients, and observables.

A step from instant k takes the inputs of instant k + ``lead_samples``, so that every model whose
observables have a finite reach is causal in its newest input. Inputs are aligned already, as
``forecast_arrays`` takes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.models import FittedAlignment, HankelDMDcModel, Model, is_ensemble, labelled
from seakeep.models.inputs import Chain, Lead
from seakeep.models.interface import Scale
from seakeep.models.observables import Bound, Observed, Term

__all__ = ["Program", "program_of", "start_rows"]


@dataclass(frozen=True, eq=False)
class Program:
    """A model as its hosts see it.

    Parameters
    ----------
    model : HankelDMDcModel
        The model.
    lead : int
        Samples by which delayed regressors look ahead.
    observed : Observed or None
        Observables beside the inputs.
    """

    model: HankelDMDcModel
    lead: int
    observed: Observed | None = field(repr=False)

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of delayed and of direct regressors."""
        signature = self.model.signature
        return signature.input_scale.mean.size, signature.direct_scale.mean.size

    @property
    def scales(self) -> dict[str, Scale]:
        """Moments by what they belong to."""
        signature = self.model.signature
        scales = (signature.state_scale, signature.input_scale, signature.direct_scale)
        return dict(zip(("state", "delayed", "direct"), scales, strict=True))

    @property
    def bound(self) -> tuple[Bound, ...]:
        """Observables of the inputs."""
        return () if self.observed is None else self.observed.bound

    def terms(self, delayed: bool) -> list[Term]:
        """Columns of the observables that take the input delays, or of those that do not."""
        return [term for each in self.bound if each.delayed == delayed for term in each.terms]

    @property
    def history(self) -> int:
        """Samples of input before the instant of a step that a start needs."""
        signature = self.model.signature
        return signature.input_map.history(signature.input_delays)

    @property
    def back(self) -> int:
        """Samples of input before the instant of a step that its newest regressors read."""
        return max([0, *(each.before - self.lead * each.delayed for each in self.bound)])

    @property
    def is_aligned(self) -> bool:
        """Whether the model was trained on inputs carried to the vessel."""
        alignment = self.model.alignment
        return alignment is not None and alignment.settings.carries

    @property
    def timing(self) -> str:
        """Which inputs a step takes, as a sentence."""
        model = self.model
        said = f"A step of {model.dt:g} s takes the inputs of the instant that it starts from."
        if ahead := model.lead_samples:
            said = (
                f"A step of {model.dt:g} s takes the inputs {ahead} samples ({ahead * model.dt:g} "
                "s) after the instant that it starts from."
            )
        if (alignment := model.alignment) is not None and self.is_aligned:
            said += (
                " They are waves carried to the vessel, as model.aligned_inputs(run) makes them."
            )
            if alignment.settings.surge == "predicted":
                said += (
                    " The loop in which the predicted surge moves them reads the whole forecast at "
                    "once, and stays in Python."
                )
        return said


def program_of(model: Model) -> Program:
    """What a model computes in one step.

    Parameters
    ----------
    model : Model
        A single linear model.

    Returns
    -------
    Program

    Raises
    ------
    RequestError
        If the model is an ensemble or another kind, or has an observable or an input map that was
        added from outside.
    """
    if is_ensemble(model):
        raise RequestError(
            f"an ensemble of {model.n_members} members cannot be exported as one model. Export one "
            "of them: --member 0, or ensemble.member(0)."
        )
    if not isinstance(model, HankelDMDcModel):
        raise RequestError(
            f"a model of kind '{model.kind}' cannot be exported; those of delayed states and "
            "inputs can: hankel_dmdc, arx, fir."
        )
    lead, observed = 0, None
    for each in Chain.of(model.signature.input_map).maps:
        if isinstance(each, Lead):
            lead = each.samples
        elif isinstance(each, Observed):
            observed = each
        elif not isinstance(each, FittedAlignment):
            raise RequestError(_strange("input map", each.kind))
    program = Program(model, lead, observed)
    for bound in program.bound:
        if not bound.terms:
            raise RequestError(_strange("observable", bound.labels[0].name))
    return program


def start_rows(model: Model, run: xr.Dataset, start: float) -> tuple[FloatArray, FloatArray]:
    """Measured rows from which an exported model starts.

    Parameters
    ----------
    model : Model
        As for :func:`seakeep.hosts.write_c`.
    run : Dataset
        As for :meth:`HankelDMDcModel.forecast`; its inputs are aligned here, if the model does so.
    start : float
        Instant k of the last measured state, s.

    Returns
    -------
    x_history : ndarray, shape (s + 1, N)
        States up to instant k, oldest first.
    u_history : ndarray, shape (rows, Q)
        Inputs up to instant k − 1 + ``lead_samples``, oldest first. The first step takes the row
        after them.

    Raises
    ------
    RequestError
        If the run does not hold these rows.
    DataError
        If there are gaps in them, or step or units of the run are not those of the model.
    """
    program = program_of(model)
    signature = program.model.signature
    name = labelled.run_name(run, "the run")
    labelled.check_run(run, name)
    labelled.check_step(run, name, signature.dt)
    labelled.check_units(run, signature.state_labels + signature.input_labels, name)
    time = np.asarray(run["time"].values, dtype=float)
    at = labelled.nearest_sample(time, labelled.as_instant(start, "start"), name)
    aligned = program.model.aligned_inputs(run)
    rows = []
    for source, names, first, stop in (
        (run, signature.states, at - signature.state_delays, at + 1),
        (aligned, signature.inputs, at - program.history, at + signature.lead_samples),
    ):
        if first < 0 or stop > time.size:
            raise RequestError(
                f"start = {start:g} s leaves no room in {name} for the {stop - first} samples of "
                f"{', '.join(names)} that the model starts from: {at - first} before it and "
                f"{max(stop - at - 1, 0)} after it. Choose an instant further inside the run."
            )
        values = labelled.channel_matrix(source, names, name, slice(first, stop))
        labelled.check_finite(values, names, name, first, time)
        rows.append(values)
    return rows[0], rows[1]


def _strange(what: str, kind: str) -> str:
    return (
        f"the {what} '{kind}' is Python code from outside seakeep, which cannot be exported. Fit "
        "the model without it, or run it in Python."
    )
