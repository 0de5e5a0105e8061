"""Reader of TOML files (campaign, study, tank), with one set of messages for mistakes.

Pydantic tables derived from :class:`Table` describe a file. The description of a field, which is
the text below it, is the remedy in a message. Lengths in encounter periods are :class:`Length`.
"""

import math
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    PlainSerializer,
    PlainValidator,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from seakeep.errors import SHOWN, MissingFileError, RequestError, did_you_mean, wanted
from seakeep.files import read_bytes, templates

KNOWN_BY = {
    "campaign": ("channels", "rig", "preparation"),
    "study": ("study", "tests", "training"),
    "tank": ("facility", "vessel", "hull", "moorings", "simulation"),
}
"""Tables that identify each kind of file when another kind is expected."""

_WRITTEN = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?inf)\s*(s|/?\s*T)\u0302?\s*"
)
_HEADER = re.compile(r"\s*\[{1,2}([^\[\]=]+)\]{1,2}\s*(?:#.*)?")
_KEY = re.compile(r"\s*((?:[\w.\s-]|\"[^\"]*\"|'[^']*')+?)\s*=")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([\w-]+)")

Settings = TypeVar("Settings", bound=BaseModel)


def packaged(path: str) -> dict[str, Any]:
    """Content of a TOML file that comes with seakeep."""
    return tomllib.loads(resources.files("seakeep").joinpath(path).read_text("utf-8"))


def rendered(room: str, template: str, **content: Any) -> str:
    """Text of a TOML file from a template of a room, with the filters ``toml`` and ``key``."""
    import tomlkit

    environment = templates(room)
    environment.filters["toml"] = lambda value: tomlkit.item(value).as_string()
    environment.filters["key"] = lambda name: tomlkit.key(name).as_string()
    return environment.get_template(template).render(**content)


@dataclass(frozen=True)
class Length:
    """A length in encounter periods (``"T"``) or seconds (``"s"``), or a frequency (``"/T"``).

    Examples
    --------
    >>> str(Length(1.5)), Length(1.5).at(1.64), str(Length(4.0, "/T"))
    ('1.5 T', 2.46, '4 /T')
    """

    value: float
    unit: Literal["T", "s", "/T"] = "T"

    def at(self, period: float) -> float:
        """Seconds or hertz, for an encounter period in seconds."""
        if self.unit == "s":
            return self.value
        return self.value * period if self.unit == "T" else self.value / period

    def __str__(self) -> str:
        return f"{self.value:.15g} {self.unit}"


def parse_length(text: str) -> Length:
    """Read a length such as ``"1.5 T"`` or ``"0.5 s"``, or a frequency such as ``"4 /T"``.

    Raises
    ------
    RequestError
        If the text says something else.

    Examples
    --------
    >>> parse_length("15 T").at(2.0), parse_length("4 /T").at(2.0)
    (30.0, 2.0)
    """
    match = _WRITTEN.fullmatch(text)
    if not match:
        raise RequestError(
            "a text in place of a number counts in encounter periods, such as '1.5 T', or in "
            "seconds, such as '0.5 s'; samples and hertz are numbers without quotes"
        )
    unit = match[2]
    return Length(float(match[1]), "/T" if "/" in unit else "s" if unit == "s" else "T")


def _length(value: object) -> Length:
    length = value if isinstance(value, Length) else parse_length(str(value))
    if length.unit == "/T":
        raise ValueError("a length is written like '1.5 T' or '0.5 s'")
    return length


def _is(words: str, fits: Callable[[float], bool]) -> AfterValidator:
    def check(length: float | Length) -> float | Length:
        if isinstance(length, Length) and not fits(length.value):
            raise ValueError(f"this length must be {words}")
        return length

    return AfterValidator(check)


def _rising(span: tuple[float | Length, float | Length]) -> tuple[float | Length, float | Length]:
    start, end = (each.value if isinstance(each, Length) else each for each in span)
    mixed = isinstance(span[0], Length) != isinstance(span[1], Length)
    if not (start < math.inf and end > -math.inf and (start < end or mixed)):
        raise ValueError(
            "a span is [start, end] in seconds of the file's clock or in encounter periods "
            "('10 T'), start before end; 'inf' stands for the end of the record"
        )
    return span


_Length = Annotated[Length, PlainValidator(_length), PlainSerializer(str)]
_Number = TypeVar("_Number")
_OrLength = Annotated[
    Annotated[_Number, Tag("<number>")] | Annotated[_Length, Tag("<length>")],
    Discriminator(lambda value: "<length>" if isinstance(value, str | Length) else "<number>"),
]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Listed = Field(strict=False)
"""Of a tuple, which TOML writes as a list."""
Pair = Annotated[tuple[Positive, Positive], Listed]
Count = Annotated[int, Field(ge=1)]
Names = Annotated[tuple[str, ...], Listed]
Duration = Annotated[_OrLength[Positive], _is("finite and positive", lambda x: 0 < x < math.inf)]
"""A positive duration: seconds or a :class:`Length`."""
Instant = Annotated[_OrLength[Finite], _is("finite", math.isfinite)]
"""An instant: seconds or a :class:`Length`."""
_Edge = _OrLength[float]
Span = Annotated[tuple[_Edge, _Edge], Listed, AfterValidator(_rising)]
"""Start and end, each in seconds or a :class:`Length`."""


class Table(BaseModel):
    """A frozen table that refuses keys it does not know, and says in our words what it refuses."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        populate_by_name=True,
        use_attribute_docstrings=True,
    )

    @model_validator(mode="wrap")
    @classmethod
    def _worded(cls, received: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if not isinstance(received, dict):  # refused, and worded by the table around it
            return handler(received)
        try:
            return handler(received)
        except ValidationError as error:
            refused = [_mistake(item, cls) for item in error.errors(include_url=False)]
        raise ValidationError.from_exception_data(
            cls.__name__,
            [
                InitErrorDetails(
                    type=PydanticCustomError(_MISTAKE, "{words}", {"words": words}),
                    loc=place,
                    input=None,
                )
                for place, words in refused
            ],
        )


_MISTAKE = "mistake"
"""Kind of the errors of pydantic that hold our words."""


def in_seconds(value: float | Length, period: float) -> float:
    """Value of a key in seconds or hertz, for an encounter period in seconds."""
    return value.at(period) if isinstance(value, Length) else value


def lengths(value: object, place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Places of the keys of a table that hold a :class:`Length`."""
    if isinstance(value, Length):
        yield place
    elif isinstance(value, BaseModel | dict):
        for name, each in dict(value).items():
            yield from lengths(each, (*place, name))
    elif isinstance(value, tuple) and any(isinstance(each, Length) for each in value):
        yield place


Mistake = tuple[tuple[str, ...], str]
"""One mistake in a file: the place of its key, and what is wrong there."""


def read_toml(path: Path, what: str, mend: str = "") -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What the messages call it: "campaign", "study" or "tank".
    mend : str, optional
        A sentence with a leading space, added where the file does not exist.

    Returns
    -------
    dict
        What it says.

    Raises
    ------
    RequestError
        If the file is missing, cannot be read, is not TOML, or is one of our files of another kind.
    """
    other = ""
    if path.suffix.lower() != ".toml":
        other = (
            f" If it holds measurements: a {what} file is expected here, whose name ends in .toml. "
            f"Draft a campaign with 'seakeep init {path.name}'."
        )
    try:
        content = read_bytes(path)
        table = tomllib.loads(content.decode("utf-8-sig"))
    except MissingFileError as error:
        raise MissingFileError(f"{error} A {what} file is expected here.{mend}") from None
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise RequestError(
            f"{path}, line {line}: not UTF-8, which TOML asks for. Save the file as UTF-8.{other}"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise RequestError(
            f"{path} is not valid TOML: {error}. Write texts in quotes, lists in [ ], "
            f"one 'key = value' per line, and each table and key once.{other}"
        ) from None
    for kind, keys in KNOWN_BY.items():
        tables = [f"[{key}]" for key in keys if key in table]
        if tables and not any(key in table for key in KNOWN_BY[what]):
            raise RequestError(
                f"{path} is a {kind} file (it has {', '.join(tables)}), and a {what} file is "
                "expected here. Name the right file."
            )
    return table


def validated(
    root: type[Settings],
    received: Mapping[str, Any],
    source: Path | str,
    what: str,
    also: Callable[[Settings], Iterable[Mistake]] | None = None,
) -> Settings:
    """Validate the contents of a file.

    Parameters
    ----------
    root : type
        The table of the whole file.
    received : mapping
        What the file says.
    source : Path or str
        The file; or what the messages call the source where there is none.
    what : str
        What the messages call it: "campaign", "study" or "tank".
    also : callable, optional
        Gives the mistakes of settings whose keys and types are right.

    Returns
    -------
    BaseModel
        The settings.

    Raises
    ------
    RequestError
        With one line per mistake: line in the file, key, value received, remedy.
    """
    try:
        settings = root.model_validate(received)
    except ValidationError as error:
        refused = [_mistake(item, root) for item in error.errors(include_url=False)]
        raise refusal(source, what, refused) from None
    if also and (mistakes := list(also(settings))):
        raise refusal(source, what, mistakes)
    return settings


def refusal(source: Path | str, what: str, mistakes: Iterable[Mistake]) -> RequestError:
    """One error that names all mistakes of a file, each with its line where it can be found."""
    text = ""
    if isinstance(source, Path):
        text = source.read_bytes().decode("utf-8-sig", "replace")
    lines = []
    for place, words in dict.fromkeys(mistakes):
        key = ".".join(place) or "the file"
        lines.append(f"  {_line_of(text, place)}{key}: {words}")
    heading = "1 mistake" if len(lines) == 1 else f"{len(lines)} mistakes"
    return RequestError(f"{source}: {heading} in the {what} file\n" + "\n".join(lines))


def _line_of(text: str, place: tuple[str, ...]) -> str:
    """Words for the line that states a key, or the innermost table around it; empty for none."""
    best, depth, table = "", 0, ()  # type: tuple[str, int, tuple[str, ...]]
    for number, line in enumerate(text.splitlines(), 1):
        if match := _HEADER.fullmatch(line):
            here = table = _parts(match[1])
        elif match := _KEY.match(line):
            here = (*table, *_parts(match[1]))
        else:
            continue
        if len(here) > depth and place[: len(here)] == here:
            best, depth = f"line {number}, ", len(here)
    return best


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple("".join(match) for match in _PART.findall(dotted))


def _mistake(item: Any, table: type[BaseModel]) -> Mistake:
    """Place and words of an error of pydantic in a table."""
    kind, value, place = item["type"], item["input"], item["loc"]
    if kind == _MISTAKE:  # of a table within it
        return tuple(map(str, place)), item["msg"]
    fields = {field.alias or name: field for name, field in table.model_fields.items()}
    field = fields.get(place[0] if place else "", Field())
    description = " ".join((field.description or "").split())
    # What follows is the place within a value, but for the keys of a dict.
    key = place[: 1 + (get_origin(field.annotation) is dict)]
    give = f" Give {description}." if description else ""
    if kind == "extra_forbidden":
        near = did_you_mean(key[-1], fields)
        words = f"unknown key, received {_shown(value)}.{near} Keys here: {', '.join(fields)}."
    elif (kind == "missing" and len(place) > 1) or kind == "too_long":
        words = f"received {_shown(value)}, a list of the wrong length ({len(value)}).{give}"
    elif kind == "too_short":
        words = f"received {_shown(value)}, which is empty.{give}"
    elif kind == "missing":
        words = f"missing. Add it: {description}." if description else "missing. Add it."
    elif kind == "value_error":
        words = f"{item['ctx']['error']}; received {_shown(value)}."
    else:
        words = f"received {_shown(value)}, which {wanted(str(item['msg']))}.{give}"
    return tuple(key), words


def _shown(value: object) -> str:
    """Value as a message shows it, cut where it is long."""
    if isinstance(value, dict):
        text = "a table with " + (", ".join(map(str, value)) or "no keys")
    elif isinstance(value, bool):
        text = str(value).lower()
    else:
        text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"
