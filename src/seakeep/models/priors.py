"""Prior distributions of the settings of an ensemble.

A prior is anything with a quantile function ``ppf``: one of the classes here, or a frozen
distribution of :mod:`scipy.stats`. One uniform number between 0 and 1 makes one draw, so Monte
Carlo and quasi-random points are used alike. A prior of a length states its unit, as in
``Uniform("10 T", "30 T")``; bare numbers count samples.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from seakeep.errors import SHOWN, RequestError, did_you_mean
from seakeep.toml import Length, parse_length

Bound = float | str | Length
"""Number, or a length such as ``"10 T"``."""


@runtime_checkable
class Prior(Protocol):
    """Interface of a prior."""

    def ppf(self, q: float) -> Any:
        """Quantile function: the value below which lies the probability `q`."""


class _Bounded:
    """Two bounds in order: finite numbers, or lengths, and the unit that they share."""

    key: ClassVar[str]
    least: ClassVar[float] = -math.inf
    low: Bound
    high: Bound
    bounds: tuple[float, ...]
    unit: str

    def __post_init__(self) -> None:
        name, stated = type(self).__name__, dict(vars(self))
        given = [*stated.values()]
        read = [parse_length(each) if isinstance(each, str) else each for each in given]
        units = {each.unit if isinstance(each, Length) else "" for each in read}
        values = [each.value if isinstance(each, Length) else each for each in read]
        if len(units) > 1:
            raise RequestError(
                f"{name} needs one unit; received {' and '.join(map(repr, given))}. Write 'T', for "
                "encounter periods, or 's' behind each number, or behind none."
            )
        finite = [float(x) for x in values if isinstance(x, int | float | np.number)]
        if len(finite) < len(values) or not all(map(math.isfinite, finite)):
            received = " and ".join(f"{each!r:.{SHOWN}}" for each in given)
            raise RequestError(f"{name} needs finite numbers; received {received}.")
        for key, value in stated.items():
            object.__setattr__(self, key, str(value) if isinstance(value, Length) else value)
        object.__setattr__(self, "bounds", tuple(finite))
        object.__setattr__(self, "unit", units.pop())
        low, high = finite
        if not low < high:
            raise RequestError(
                f"{name} needs its lower bound below the upper one; received {self.low!r} and "
                f"{self.high!r}. Swap them, or state a single value as it is."
            )
        if low < self.least:
            raise RequestError(
                f"{name} needs a positive lower bound; received {self.low!r}. Logarithms start "
                "above zero."
            )


@dataclass(frozen=True)
class Uniform(_Bounded):
    """Uniform between two bounds, as in the paper.

    Parameters
    ----------
    low, high : float or str
        Bounds; of a length ``"10 T"``, ``"0.5 s"``, or samples.

    Raises
    ------
    RequestError
        If they are not finite, not in order, or of two units.

    Examples
    --------
    >>> Uniform("10 T", "30 T").ppf(0.25)
    15.0
    """

    key: ClassVar[str] = "uniform"
    low: Bound
    high: Bound

    def ppf(self, q: float) -> float:
        """Quantile function."""
        low, high = self.bounds
        return low + (high - low) * q


@dataclass(frozen=True)
class LogUniform(_Bounded):
    """Uniform in the logarithm between two positive bounds.

    Parameters
    ----------
    low, high : float or str
        Bounds; of a length ``"10 T"``, ``"0.5 s"``, or samples.

    Raises
    ------
    RequestError
        If they are not finite, not positive, not in order, or of two units.

    Examples
    --------
    >>> round(LogUniform(1, 100).ppf(0.5), 12)
    10.0
    """

    key: ClassVar[str] = "log_uniform"
    least: ClassVar[float] = float(np.finfo(float).tiny)
    low: Bound
    high: Bound

    def ppf(self, q: float) -> float:
        """Quantile function."""
        low, high = self.bounds
        return float(low * (high / low) ** q)


@dataclass(frozen=True)
class Distribution:
    """A distribution of :mod:`scipy.stats` by its name.

    Parameters
    ----------
    distribution : str
        Name, such as ``"norm"``.
    parameters : mapping of str to float, optional
        Its parameters, such as ``{"loc": 1.0, "scale": 0.1}``.
    unit : str, optional
        Of a length: ``"T"``, encounter periods, or ``"s"``; samples by default.

    Raises
    ------
    RequestError
        If SciPy has no such distribution, or it takes other parameters.
    """

    distribution: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""

    def __post_init__(self) -> None:
        from scipy import stats

        kinds = stats.rv_continuous | stats.rv_discrete
        law = getattr(stats, self.distribution, None)
        if not isinstance(law, kinds):
            known = [name for name in dir(stats) if isinstance(getattr(stats, name), kinds)]
            raise RequestError(
                f"scipy.stats has no distribution '{self.distribution}'."
                f"{did_you_mean(self.distribution, known)} Name another one."
            )
        if self.unit not in ("", "s", "T"):
            raise RequestError(f"the unit of a prior is 'T' or 's'; received {self.unit!r}.")
        shapes = f"{law.shapes}, loc, scale" if law.shapes else "loc, scale"
        try:
            median = float(self.ppf(0.5))
        except TypeError:
            raise RequestError(
                f"'parameters' of '{law.name}' are {shapes}, of which loc and scale may be left "
                f"out; received {', '.join(self.parameters) or 'none'}."
            ) from None
        if not math.isfinite(median):
            raise RequestError(f"'{law.name}' with these 'parameters' has no median; correct them.")

    def ppf(self, q: float) -> float:
        """Quantile function."""
        from scipy import stats

        return float(getattr(stats, self.distribution).ppf(q, **self.parameters))


_OWN: dict[str, Any] = {each.key: each for each in (Uniform, LogUniform)}


def prior_of(name: str, value: object) -> Prior | None:
    """Read the prior of a setting.

    Parameters
    ----------
    name : str
        The setting.
    value : object
        A prior, a table such as ``{"uniform": ["10 T", "30 T"]}``, or something else.

    Returns
    -------
    Prior or None
        None for what is neither.

    Raises
    ------
    RequestError
        If a table is not that of a prior.
    """
    if isinstance(value, Prior):
        return value
    if not isinstance(value, Mapping):
        return None
    try:
        if "distribution" in value:
            return Distribution(**value)
        ((key, given),) = value.items()
        if not isinstance(given, list | tuple):
            raise TypeError
        return _OWN[key](*given)
    except RequestError as error:
        raise RequestError(f"{name}: {error}") from None
    except (TypeError, ValueError, KeyError):
        raise RequestError(
            f"{name}: a prior is one of {{ uniform = [a, b] }}, {{ log_uniform = [a, b] }}, "
            "{ distribution = 'name', parameters = { … } }; received "
            f"{value!r:.{SHOWN}}. A single value stands as it is: {name} = 5."
        ) from None


def prior_json(prior: Prior) -> dict[str, Any]:
    """A prior as its table, for a file.

    Parameters
    ----------
    prior : Prior
        One of this module, or a frozen distribution of scipy.stats by its public name.

    Returns
    -------
    dict
        The table; :func:`prior_of` reads it.

    Raises
    ------
    RequestError
        If the prior is of another kind.
    """
    if isinstance(prior, _Bounded):
        return {prior.key: [prior.low, prior.high]}
    if isinstance(prior, Distribution):
        return {**asdict(prior), "parameters": dict(prior.parameters)}
    dist: Any = getattr(prior, "dist", None)
    if dist is None:
        raise RequestError(
            f"the prior {prior!r} cannot be written to a file. Use one of seakeep's, or a frozen "
            "distribution of scipy.stats."
        )
    shapes = [each.strip() for each in (dist.shapes or "").split(",") if each]
    given = zip([*shapes, "loc", "scale"], getattr(prior, "args", ()), strict=False)
    stated = dict(given) | getattr(prior, "kwds", {})
    parameters = {name: float(value) for name, value in stated.items()}
    return prior_json(Distribution(dist.name, parameters))


def unit_of(written: object) -> str:
    """Unit of a length as a file states it: a prior, a text, or a number of samples."""
    length = parse_length(written) if isinstance(written, str) else prior_of("", written)
    return {"T": "encounter periods", "s": "s"}.get(getattr(length, "unit", ""), "samples")
