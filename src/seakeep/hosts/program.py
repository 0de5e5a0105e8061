"""What hosts other than Python ask of a model: whether it can be exported, and where it starts.

A step from instant k takes the inputs of instant k + ``lead_samples``, so that every model whose
observables and carriers have a finite reach is causal in its newest input. Inputs are as measured.
"""

import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.models import HankelDMDcModel, Model, is_ensemble, labelled
from seakeep.models.registry import is_linear


def exportable(model: Model, follows: bool = False) -> HankelDMDcModel:
    """A model that hosts can run.

    Parameters
    ----------
    model : Model
        A single linear model.
    follows : bool
        Whether it is to follow a vessel, for which a model must keep its errors in training.

    Returns
    -------
    HankelDMDcModel
        The model itself.

    Raises
    ------
    RequestError
        If the model is an ensemble or another kind, is driven by waves that are carried to a
        measured surge, or has an observable without terms.
    """
    model.signature.check_fixed()
    if follows and (is_ensemble(model) or (is_linear(model) and model.errors is None)):
        raise RequestError(
            "an estimator is one model and its errors in training, and an ensemble keeps those of "
            "all its members together. Fit a single model of the same runs (kind = 'hankel_dmdc'; "
            "a recommended ensemble is centred on it) and export that, or leave --estimator out "
            "and export a member as a simulator: --member 0."
        )
    if is_ensemble(model):
        raise RequestError(
            f"an ensemble of {model.n_members} members cannot be exported as one model. Export one "
            "of them: --member 0, or ensemble.member(0)."
        )
    if not is_linear(model):
        raise RequestError(
            f"a model of kind '{model.kind}' cannot be exported; those of delayed states and "
            "inputs can: hankel_dmdc, arx, fir."
        )
    if model.variation:
        raise RequestError(
            f"the model varies with {model.signature.parameter}. Export it at a value: in Python, "
            "model.at(parameter=…)."
        )
    input_map = model.signature.input_map
    aligned = input_map.alignment
    if not input_map.follows and aligned and aligned.settings.carries:
        to = " to the measured surge" if input_map.reads_surge else ""
        raise RequestError(
            f"the model is driven by waves that are carried over whole records{to}, which no step "
            "can make. Fit it with alignment mode = 'dispersion', surge = 'predicted': that "
            "recursion runs on every host, fed with the probes as they are measured; or without "
            "alignment."
        )
    for bound in input_map.observed.bound:
        if not bound.terms:
            raise RequestError(
                f"the observable '{bound.labels[0].name}' states no terms, by which other "
                "hosts could compute it. Fit the model without it, or run it in Python."
            )
    return model


def timing(model: HankelDMDcModel, follows: bool = False) -> str:
    """Which inputs a step takes, as a sentence; or a step that `follows` a vessel."""
    if follows:
        return (
            f"It follows a vessel: a step of {model.dt:g} s takes the inputs and states of one "
            "instant as measured, NaN where they were not."
        )
    said = f"A step of {model.dt:g} s takes the inputs of the instant that it starts from."
    if ahead := model.lead_samples:
        said = (
            f"A step of {model.dt:g} s takes the inputs {ahead} samples ({ahead * model.dt:g} "
            "s) after the instant that it starts from."
        )
    if model.signature.input_map.follows:
        said += (
            " They are the probes as measured, where they stood in training: the step carries "
            "the waves to the vessel by its own surge."
        )
    return said


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
    signature = exportable(model).signature
    labels = signature.state_labels + signature.input_labels
    name, time = labelled.opened(run, "the run", signature.dt, labels)
    at = labelled.nearest_sample(time, start, name)
    rows = []
    for names, first, stop in (
        (signature.states, at + 1 - signature.state_samples, at + 1),
        (signature.inputs, at - signature.input_history, at + signature.lead_samples),
    ):
        if first < 0 or stop > time.size:
            raise RequestError(
                f"start = {start:g} s leaves no room in {name} for the {stop - first} samples of "
                f"{', '.join(names)} that the model starts from: {at - first} before it and "
                f"{max(stop - at - 1, 0)} after it. Choose an instant further inside the run."
            )
        rows.append(labelled.sound_matrix(run, names, name, slice(first, stop)))
    return rows[0], rows[1]
