"""What a model computes in one step, for any host: sizes, coefficients, carriers, and observables.

A step from instant k takes the inputs of instant k + ``lead_samples``, so that every model whose
observables and carriers have a finite reach is causal in its newest input. Inputs are as measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.models import FittedAlignment, HankelDMDcModel, Model, is_ensemble, labelled
from seakeep.models.following import Bank, Following
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
        Samples by which delayed regressors look ahead; 0 where carriers do.
    observed : Observed or None
        Observables beside the inputs.
    following : Following or None
        Carriers and place of a model that follows its own surge.
    """

    model: HankelDMDcModel
    lead: int
    observed: Observed | None = field(repr=False)
    following: Following | None = field(repr=False)

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
        carriers = 0 if self.following is None else self.following.back
        return max([carriers, *(each.before - self.lead * each.delayed for each in self.bound)])

    @property
    def banks(self) -> tuple[Bank, ...]:
        """Carriers of each elevation, with the probes as they stood in training."""
        return () if self.following is None else self.following.banks(None)

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
        if self.following is not None:
            said += (
                " They are the probes as measured, where they stood in training: the step carries "
                "the waves to the vessel by its own surge."
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
        If the model is an ensemble or another kind, is driven by waves that are carried to a
        measured surge, or has an observable or an input map that was added from outside.
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
    chain = Chain.of(model.signature.input_map)
    known = (Lead, Following, FittedAlignment, Observed)
    if strange := [each.kind for each in chain.maps if not isinstance(each, known)]:
        raise RequestError(_strange("input map", strange[0]))
    following = next((each for each in chain.maps if isinstance(each, Following)), None)
    if following is None and chain.alignment is not None and chain.alignment.settings.carries:
        raise RequestError(
            "the model is driven by waves that are carried over whole records"
            f"{' to the measured surge' if chain.reads_surge else ''}, which no step can make. Fit "
            "it with alignment mode = 'dispersion', surge = 'predicted': that recursion runs on "
            "every host, fed with the probes as they are measured; or without alignment."
        )
    lead = sum(each.samples for each in chain.maps if isinstance(each, Lead))
    program = Program(model, lead, chain.observed, following)
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
        As for :meth:`HankelDMDcModel.forecast`.
    start : float
        Instant k of the last measured state, s.

    Returns
    -------
    x_history : ndarray, shape (rows, N)
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
    rows = []
    for names, first, stop in (
        (signature.states, at + 1 - signature.state_samples, at + 1),
        (signature.inputs, at - program.history, at + signature.lead_samples),
    ):
        if first < 0 or stop > time.size:
            raise RequestError(
                f"start = {start:g} s leaves no room in {name} for the {stop - first} samples of "
                f"{', '.join(names)} that the model starts from: {at - first} before it and "
                f"{max(stop - at - 1, 0)} after it. Choose an instant further inside the run."
            )
        values = labelled.channel_matrix(run, names, name, slice(first, stop))
        labelled.check_finite(values, names, name, first, time)
        rows.append(values)
    return rows[0], rows[1]


def _strange(what: str, kind: str) -> str:
    return (
        f"the {what} '{kind}' is Python code from outside seakeep, which cannot be exported. Fit "
        "the model without it, or run it in Python."
    )
