"""Prior distributions of the settings of an ensemble.

A prior is anything with a quantile function ``ppf``: one of the classes here, or a frozen
distribution of :mod:`scipy.stats`. One uniform number between 0 and 1 makes one draw, so Monte
Carlo and quasi-random points are used alike.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from seakeep.errors import SHOWN, DataError, RequestError

__all__ = ["Fixed", "LogUniform", "Prior", "Uniform", "check_prior", "describe", "from_description"]


@runtime_checkable
class Prior(Protocol):
    """Interface of a prior."""

    def ppf(self, q: float) -> Any:
        """Quantile function: the value below which lies the probability `q`."""
        ...


def _check_bounds(name: str, low: object, high: object, least: float) -> None:
    numbers = [value for value in (low, high) if isinstance(value, int | float | np.number)]
    if len(numbers) < 2 or not all(math.isfinite(value) for value in numbers):
        raise RequestError(
            f"{name} needs two finite numbers; received {low!r:.{SHOWN}} and {high!r:.{SHOWN}}."
        )
    if not numbers[0] < numbers[1]:
        raise RequestError(
            f"{name} needs its lower bound below the upper one; received {low!r} and {high!r}. "
            "Swap them, or use seakeep.Fixed for a single value."
        )
    if numbers[0] < least:
        raise RequestError(
            f"{name} needs a positive lower bound; received {low!r}. Logarithms start above zero."
        )


@dataclass(frozen=True)
class Uniform:
    """Uniform between two bounds, as in the paper.

    Parameters
    ----------
    low, high : float
        Bounds.

    Raises
    ------
    RequestError
        If they are not finite, or not in order.

    Examples
    --------
    >>> Uniform(10, 30).ppf(0.25)
    15.0
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        _check_bounds("Uniform", self.low, self.high, -math.inf)

    def ppf(self, q: float) -> float:
        """Quantile function."""
        return float(self.low + (self.high - self.low) * q)


@dataclass(frozen=True)
class LogUniform:
    """Uniform in the logarithm between two positive bounds.

    Parameters
    ----------
    low, high : float
        Bounds.

    Raises
    ------
    RequestError
        If they are not finite, not positive, or not in order.

    Examples
    --------
    >>> round(LogUniform(1, 100).ppf(0.5), 12)
    10.0
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        _check_bounds("LogUniform", self.low, self.high, np.finfo(float).tiny)

    def ppf(self, q: float) -> float:
        """Quantile function."""
        return float(self.low * (self.high / self.low) ** q)


@dataclass(frozen=True)
class Fixed:
    """One value, the same for every member.

    Parameters
    ----------
    value : float
        The value.

    Raises
    ------
    RequestError
        If it is not a finite number.
    """

    value: float

    def __post_init__(self) -> None:
        if not isinstance(self.value, int | float | np.number) or not math.isfinite(self.value):
            raise RequestError(f"Fixed needs a finite number; received {self.value!r:.{SHOWN}}.")

    def ppf(self, q: float) -> float:
        """Quantile function: the value, for any probability."""
        return float(self.value)


def check_prior(name: str, prior: object) -> None:
    """Refuse what is not a prior; `name` is the setting it is for."""
    if not isinstance(prior, Prior):
        raise RequestError(
            f"{name} must be a prior; received {prior!r:.{SHOWN}}. Pass "
            "seakeep.Uniform(low, high), seakeep.LogUniform(low, high), seakeep.Fixed(value), or a "
            "frozen distribution such as scipy.stats.norm(20, 2)."
        )


def describe(prior: Prior | None) -> dict[str, Any] | None:
    """A prior as plain data, for a file.

    Parameters
    ----------
    prior : Prior or None
        One of this module, or a frozen distribution of scipy.stats by its public name.

    Returns
    -------
    dict or None
        Name and parameters.

    Raises
    ------
    RequestError
        If the prior is of another kind.
    """
    if prior is None:
        return None
    if isinstance(prior, Uniform | LogUniform | Fixed):
        return {"prior": type(prior).__name__} | {k: float(v) for k, v in asdict(prior).items()}
    distribution = getattr(getattr(prior, "dist", None), "name", None)
    if distribution is None:
        raise RequestError(
            f"the prior {prior!r} cannot be written to a file. Use one of seakeep's, or a frozen "
            "distribution of scipy.stats."
        )
    args = [float(value) for value in getattr(prior, "args", ())]
    kwds = {key: float(value) for key, value in getattr(prior, "kwds", {}).items()}
    return {"prior": f"scipy.stats.{distribution}", "args": args, "kwds": kwds}


def from_description(setting: str, content: object) -> Prior | None:
    """Rebuild the prior of a setting from :func:`describe`; DataError for what is not known."""
    if content is None:
        return None
    if not isinstance(content, dict) or "prior" not in content:
        raise DataError(
            f"{setting}: a prior is a table with the key 'prior'; received {content!r:.{SHOWN}}. "
            "Fit the model again."
        )
    name = str(content["prior"])
    own: dict[str, Any] = {each.__name__: each for each in (Uniform, LogUniform, Fixed)}
    if name in own:
        bounds = {key: value for key, value in content.items() if key != "prior"}
        made: Prior = own[name](**bounds)
        return made
    from scipy import stats

    distribution = getattr(stats, name.removeprefix("scipy.stats."), None)
    if not isinstance(distribution, stats.rv_continuous | stats.rv_discrete):
        raise DataError(
            f"{setting}: the prior '{name:.{SHOWN}}' is not known here. Update seakeep or SciPy."
        )
    frozen: Prior = distribution(*content["args"], **content["kwds"])
    return frozen
