"""Types and checks of the arrays, numbers and settings that public functions take.

Every public function passes its arrays through :func:`as_real` or :func:`as_series`, which refuse
what is not an array of real numbers: masked values, complex numbers, dates and text. The message
says what was received and how to correct it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from seakeep.errors import SHOWN, DataError, RequestError, SeakeepError, did_you_mean

if TYPE_CHECKING:
    import xarray as xr

ArrayLike = npt.ArrayLike
FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.intp]
ComplexArray = npt.NDArray[np.complex128]

Progress = Callable[[int, int, str], None]
"""Takes how many steps are done, how many there are, and the name of one."""
undefined = partial(np.errstate, divide="ignore", invalid="ignore", over="ignore")
"""Lets 0/0 be NaN, and x/0 and what is too large infinite, without a warning."""
TINY = float(np.finfo(float).tiny)
"""Least number above zero."""
Datasets: TypeAlias = "Mapping[str, xr.Dataset]"
"""Prepared runs, tables or groups of a result, by name."""
Groups: TypeAlias = "dict[str, xr.Dataset]"
"""The same, in a dictionary that its owner may change."""
Json = dict[str, Any]
"""Settings as JSON values."""
Settings = TypeVar("Settings")

_REMEDIES = {
    "c": "Give its real part or its modulus",
    "M": "Give seconds: (t - t[0]) / numpy.timedelta64(1, 's')",
    "m": "Give seconds: t / numpy.timedelta64(1, 's')",
    "U": "Convert the text to numbers",
    "S": "Convert the text to numbers",
}


def as_real(
    values: object,
    name: str,
    error: type[SeakeepError] = RequestError,
) -> FloatArray:
    """Return real numbers as an array of floats.

    Parameters
    ----------
    values : array_like
        Numbers, of any shape; a masked array without masked values is taken as it is.
    name : str
        What messages call them.
    error : type, optional
        What is raised; a DataError where the values come from a file.

    Returns
    -------
    ndarray

    Raises
    ------
    RequestError
        If they are not real numbers: masked values, complex, dates or text, Datasets.

    Examples
    --------
    >>> as_real([1, 2], "the series")
    array([1., 2.])
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    parts = values if isinstance(values, list | tuple) else [values]
    if masked := sum(int(np.ma.getmaskarray(part).sum()) for part in parts if np.ma.isMA(part)):
        raise error(
            f"{name} holds {masked} masked value(s), which would be read as if they were "
            "not masked. Fill them with numpy.ma.filled(values, numpy.nan) and treat them as a "
            "gap, or leave them out."
        )
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as why:  # a Dataset, or rows of several lengths
        raise error(
            f"{name} must be one array of real numbers; received {type(values).__name__}. Give a "
            f"channel, such as run['heave'], or rows of one length. ({why})"
        ) from None
    if array.dtype.kind not in "fiub":
        remedy = _REMEDIES.get(array.dtype.kind, "Convert every value to a number, gaps to NaN")
        raise error(
            f"{name} must be real numbers; received {type(values).__name__} of type "
            f"{array.dtype}. {remedy}."
        )
    return np.asarray(array, np.float64)


def as_series(
    values: object, name: str = "the series", *, minimum: int = 2, channels: bool = False
) -> FloatArray:
    """Return a uniformly sampled series without gaps, or several side by side.

    Parameters
    ----------
    values : array_like, shape (time,), or (time, …) with `channels`
        Samples.
    name : str, optional
        What messages call it.
    minimum : int, optional
        Fewest samples.
    channels : bool, optional
        Whether there may be axes behind that of time.

    Returns
    -------
    ndarray, of the same shape

    Raises
    ------
    RequestError
        If it is not an array of real numbers, or of another shape.
    DataError
        If it has fewer samples, or values that are not finite.
    """
    array = as_real(values, name)
    if array.ndim == 0 or (array.ndim > 1 and not channels):
        wanted = "time along the first axis: (time,) or (time, channel)" if channels else "(time,)"
        raise RequestError(
            f"{name} has shape {array.shape}; expected {wanted}. Select one channel and one "
            "run, or keep the axis of time."
        )
    if array.shape[0] < minimum:
        raise DataError(
            f"{name} has {array.shape[0]} sample(s); at least {minimum} are needed; received shape "
            f"{array.shape}. Time runs along the first axis; give a longer series."
        )
    if array.size == 0:
        raise RequestError(f"{name} has shape {array.shape}; give at least one channel.")
    return finite(array, name)


def as_bundle(values: object, name: str = "the series") -> FloatArray:
    """Return one series, or several of equal length, as rows.

    Parameters
    ----------
    values : array_like, shape (time,) or (series, time)
        Samples; time runs along the last axis.
    name : str, optional
        What messages call them.

    Returns
    -------
    ndarray, shape (series, time)

    Raises
    ------
    RequestError
        If it is not an array of real numbers, has no axis or more than two, or holds no series.
    DataError
        If the series are shorter, or a value is not finite.
    """
    array = as_real(values, name)
    if array.ndim not in (1, 2) or (array.ndim == 2 and array.shape[0] == 0):
        raise RequestError(f"{name} has shape {array.shape}; expected (time,) or (series, time).")
    if array.shape[-1] < 2:
        raise DataError(
            f"{name} has {array.shape[-1]} sample(s); at least 2 are needed. Give a longer series."
        )
    finite(array.T, name)
    return np.atleast_2d(array)


def as_pair(
    first: object, second: object, *, minimum: int = 2, moving: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return two series of one length, of at least `minimum` samples; `moving` ones vary.

    Raises
    ------
    RequestError
        If they are not series, or differ in length.
    DataError
        As :func:`as_series`; also if one is constant and must be `moving`.
    """
    pair = {
        name: as_series(each, f"the {name} record", minimum=minimum)
        for name, each in (("first", first), ("second", second))
    }
    a, b = pair.values()
    if a.shape != b.shape:
        raise RequestError(
            f"two records of the same length are needed, shape (time,); received {a.shape} and "
            f"{b.shape}. Cut them to their common time."
        )
    for name, each in pair.items():
        if moving and np.ptp(each) == 0:
            raise DataError(
                f"the {name} record is constant ({each[0]:g}), so it correlates with nothing. "
                "Look for a dead probe."
            )
    return a, b


def ratio(values: Any, per: FloatArray, without: float = np.nan) -> Any:
    """Quotient of arrays, and what stands where nothing is divided by."""
    with undefined():
        return np.where(per > 0, values / per, without)


def finite(array: FloatArray, name: str) -> FloatArray:
    """Return an array of at least one axis as it is; refuse NaN and infinity."""
    there = np.isfinite(array)
    if not there.all():
        first = np.argmin(there.reshape(len(array), -1).all(axis=1))
        raise DataError(
            f"{name} holds {int(np.count_nonzero(~there))} value(s) that are NaN or infinite, of "
            f"{array.size}, the first at sample {first}. Fill or cut the gap first "
            "(seakeep.signals.bridge); leave a diverged forecast out and count it."
        )
    return array


def number(
    value: Any,
    name: str,
    meant: str = "a number",
    low: float = -np.inf,
    high: float = np.inf,
    hint: str = "",
) -> float:
    """Return a finite number from `low` on and below `high` as a float; refuse text and dates."""
    one = hasattr(value, "item") and value is not np.ma.masked and np.size(value) == 1
    plain = value.item() if one else value
    real = isinstance(plain, int | float) and not isinstance(plain, bool)
    if not real or not np.isfinite(plain) or not low <= plain < high:
        raise RequestError(f"{name} must be {meant}; received {value!r:.{SHOWN}}.{hint}")
    return float(plain)


def positive(value: object, name: str, unit: str) -> float:
    """Return a finite, positive number as a float."""
    return number(value, name, f"positive ({unit})", TINY)


def time_step(value: object) -> float:
    """Return a time step in seconds as a float."""
    return positive(value, "the time step", "s")


def fraction(value: object, name: str) -> float:
    """Return a number between 0 and 1, both excluded."""
    return number(value, name, "between 0 and 1", TINY, 1.0)


def whole_number(value: object, name: str, least: int = 1) -> int:
    """Return a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise RequestError(f"{name} must be an integer of at least {least}; received {value!r}.")
    return int(value)


def as_table(value: object, name: str) -> Mapping[Any, Any]:
    """Mapping as it is; anything else raises a RequestError."""
    if not isinstance(value, Mapping):
        raise RequestError(f"{name} must be a mapping, such as a dict; received {value!r}.")
    return value


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse a setting that is none of two or more words.

    Parameters
    ----------
    name : str
        What the message calls the setting.
    value : object
        What was received.
    choices : sequence of str
        The words.

    Raises
    ------
    RequestError
        If it is none of them.
    """
    if not isinstance(value, str) or value not in choices:
        *first, last = (f"'{word}'" for word in choices)
        raise RequestError(
            f"{name} must be {', '.join(first)} or {last}; received {value!r:.{SHOWN}}."
        )


def check_flag(name: str, value: object) -> None:
    """Refuse a setting that is neither true nor false."""
    if not isinstance(value, bool | np.bool_):
        raise RequestError(f"{name} must be True or False; received {value!r:.{SHOWN}}.")


def names_of(value: Any, what: str, example: str) -> tuple[str, ...]:
    """Names in a list, each once; refuses a text, which is no list, and an empty list."""
    is_list = isinstance(value, Iterable) and not isinstance(value, str)
    names = tuple(dict.fromkeys(value)) if is_list else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise RequestError(
            f"{what} must be a list of one or more names; received {value!r:.{SHOWN}}. Write "
            f"{example}."
        )
    return names


def plain(value: Any) -> Any:
    """Return JSON values with numbers and arrays of numpy and tuples in them as plain ones."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def settings_of(kind: type[Settings], name: str, value: object, example: str) -> Settings | None:
    """Return settings as they are, or made of a table of their keys; None stays None.

    Parameters
    ----------
    kind : type
        Dataclass of the settings.
    name : str
        What messages call the setting.
    value : kind, mapping or None
        What was received.
    example : str
        Arguments of a call that makes such settings.

    Returns
    -------
    kind or None

    Raises
    ------
    RequestError
        If it is something else, or a key is not known.
    """
    if value is None or isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise RequestError(
            f"{name} must be a seakeep.{kind.__name__} or None; received {value!r:.{SHOWN}}. Write "
            f"{name}=seakeep.{kind.__name__}({example})."
        )
    check_keys(kind, value, f"{name}: ")
    return kind(**value)


def check_keys(kind: type, table: Mapping[str, object], what: str = "") -> None:
    """Refuse a table that has a key which a dataclass lacks, or lacks one that it needs.

    Parameters
    ----------
    kind : type
        The dataclass.
    table : mapping
        Its arguments.
    what : str, optional
        Start of the message, such as ``"alignment: "``.

    Raises
    ------
    RequestError
        Of the first such key.
    """
    taken = [each for each in fields(kind) if each.init]
    known = [each.name for each in taken]
    listed = f"Keys: {', '.join(known)}."
    for key in table:
        if key not in known:
            raise RequestError(
                f"{what}unknown key '{key}'.{did_you_mean(str(key), known)} {listed}"
            )
    missing = [
        each.name
        for each in taken
        if each.default is MISSING and each.default_factory is MISSING and each.name not in table
    ]
    if missing:
        raise RequestError(f"{what}the key '{missing[0]}' is missing. {listed}")
