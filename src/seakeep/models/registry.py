"""Kinds of models, and the files that hold them."""

from pathlib import Path
from typing import TypeGuard, TypeVar, overload

from seakeep.errors import DataError, MissingFileError, RequestError
from seakeep.files import load_sealed
from seakeep.models import store
from seakeep.models.baselines import ARX, FIR, HoldLast, Mean, Subspace
from seakeep.models.ensemble import HankelEnsemble
from seakeep.models.forecasts import Model, Spec
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.specs import BayesianHankelDMDc, HankelDMDc

KINDS: dict[str, type[Spec]] = {
    each.kind: each for each in (HankelDMDc, BayesianHankelDMDc, HoldLast, Mean, FIR, ARX, Subspace)
}
"""Specs by the word that TOML tables and files call their kind; one line adds a model."""

Kind = TypeVar("Kind")


def is_ensemble(model: Model) -> TypeGuard[HankelEnsemble]:
    """Whether a model has members, and so a band, as its kind in :data:`KINDS` states."""
    return KINDS[model.kind].is_ensemble


def is_linear(model: Model) -> TypeGuard[HankelDMDcModel]:
    """Whether a model is one matrix of delayed states and inputs, as a Hankel, ARX or FIR model."""
    return isinstance(model, HankelDMDcModel)


@overload
def load_model(path: str | Path) -> Model: ...
@overload
def load_model(path: str | Path, kind: type[Kind]) -> Kind: ...
def load_model(path: str | Path, kind: type[Kind] | None = None) -> Model | Kind:
    """Read a model or an ensemble that was saved; no code from the file is run.

    Parameters
    ----------
    path : str or Path
        File written by ``model.save`` or ``seakeep fit``.
    kind : type, optional
        What is expected, such as :class:`seakeep.HankelEnsemble`: type checkers know the result
        then, and another kind of model is refused.

    Returns
    -------
    Model
        The model, equal to the last bit: a :class:`seakeep.HankelDMDcModel`, a
        :class:`seakeep.HankelEnsemble`, or what its kind in :data:`KINDS` fits.

    Raises
    ------
    RequestError
        If there is no such file, or it holds another kind of model.
    DataError
        If it is damaged, not a model, or of another layout.
    """
    source = Path(path)
    if source.suffix.lower() == ".toml":
        raise RequestError(
            f"{source} is a campaign file, and a model file is expected here: the model comes "
            "first, and then the campaign."
        )
    try:
        dataset = load_sealed(source, store.MODEL)
    except MissingFileError as error:
        raise MissingFileError(
            f"{error} A model file is expected here: make one with `seakeep fit` or "
            "model.save(...)."
        ) from None
    word = dataset.attrs["seakeep_kind"]
    if word not in KINDS:
        raise DataError(
            f"{path} holds a model of kind '{word}', which this version does not know. Update "
            "seakeep, or import the module that adds it."
        )
    model = KINDS[word].restore(dataset)
    if kind is None:
        return model
    if not isinstance(model, kind):
        raise RequestError(
            f"{path} holds a {type(model).__name__}, and a {kind.__name__} is expected. Name "
            "another file, or fit one."
        )
    return model
