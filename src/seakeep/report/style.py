"""One look and one frame for all figures: colours that survive grey print and colour blindness."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from seakeep.campaign.settings import long_name_of
from seakeep.conventions import canonical_channel, displayed
from seakeep.errors import RequestError, needing
from seakeep.files import MARK, replacing
from seakeep.toml import packaged

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure
    import xarray as xr

    from seakeep.study import StudyResult

Figure: TypeAlias = "matplotlib.figure.Figure"
Places: TypeAlias = "Sequence[matplotlib.axes.Axes] | matplotlib.axes.Axes | None"

_STYLE = packaged("report/templates/style.toml")


def _line(colour: str, width: float, dash: Sequence[float] = ()) -> dict[str, Any]:
    """Line as matplotlib takes it, from one of the style sheet."""
    style = (0, tuple(dash)) if dash else "-"
    return {"color": PALETTE[colour], "linewidth": width, "linestyle": style}


PALETTE = _STYLE["palette"]
COLOURS = {what: PALETTE[colour] for what, colour in _STYLE["colours"].items()}
"""By what a line shows."""

LINES = {what: _line(**each) for what, each in _STYLE["lines"].items()}
"""Lines differ in dash and width as well as in colour."""
DASHED = LINES["forecast"]["linestyle"]

SERIES = [_line(**each) | {"marker": marker} for marker, each in _STYLE["series"].items()]
"""Colour, dash and marker of each of several things of one kind."""

FLAGGED, MARKS, TESTS = (_STYLE[what] for what in ("flags", "marks", "tests"))
"""Flagged samples; measured points, by the kind of the waves; runs, by what they are to a model."""

HEADING = {"nrmse": "ANRMSE", "nammae": "NAMMAE"}
"""Measures that figures and tables show, with the names of their averages over the channels.

The paper's two. Tables take their columns for these from ``report/templates/words.toml``.
"""

WIDEST = 18
"""Letters of a label on one line: what the height of a panel holds."""
NARROW = 14
"""Letters of a label on one line beside others, or between panels."""
NARROWEST = 7.5
"""Inches: a page stretches figures to its width, and a legend needs room."""

_WITH_PREFIX = ("N", "N m", "Pa", "W")
"""Units whose values run into millions at full scale."""


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in our style, without touching anybody's global settings; a decorator too."""
    with needing("drawing figures", "figures"):
        import matplotlib as mpl
    with mpl.rc_context(_STYLE["rc"]):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, in inches; draw on it inside :func:`figure_style`."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def panels(
    axes: Places, count: int, most: int, size: tuple[float, float]
) -> tuple[Figure, list[Any]]:
    """Axes that are given, as many as needed, or those of a new figure; `size` is that of one.

    A new figure has rows of `most` panels, or of fewer that fill as few rows.
    """
    if count == 0:
        raise RequestError("there is nothing to draw. Name at least one channel or state.")
    if axes is None:
        rows = -(-count // most)
        columns = -(-count // rows)
        figure = new_figure(max(size[0] * columns, NARROWEST), 0.5 + size[1] * rows)
        every = list(figure.subplots(rows, columns, squeeze=False).ravel())
        for spare in every[count:]:
            spare.remove()
        return figure, every[:count]
    given = np.ravel([axes]).tolist()
    if len(given) != count:
        raise RequestError(
            f"axes holds {len(given)} Axes and the figure draws {count} panels. Give as many, or "
            "none."
        )
    return given[0].figure, given


def legend_outside(*places: Any, side: str = "lower center", **options: Any) -> Any:
    """Legend beside all panels of a figure of what some label, in as many columns as fit."""
    unique: dict[str, Any] = {}
    for place in places:
        handles, labels = place.get_legend_handles_labels()
        unique |= dict(zip(labels, handles, strict=True))
    if not unique:
        return None
    figure = places[0].figure
    across = max(1, int(13 * figure.get_figwidth() / (8 + max(map(len, unique)))))  # letters
    options |= {"loc": f"outside {side}", "ncols": min(len(unique), across)}
    return figure.legend(unique.values(), unique, **options)


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure to a temporary name and rename it; the suffix decides the format."""
    with figure_style(), replacing(path) as temporary:
        kind = path.suffix.removeprefix(".")
        if kind != "png":
            figure.savefig(temporary, format=kind, metadata={"Creator": f"{MARK}: figure"})
            return path
        from PIL import Image, PngImagePlugin  # comes with matplotlib

        figure.savefig(temporary, format=kind)
        mark = PngImagePlugin.PngInfo()
        mark.add_text("Software", f"{MARK}: figure")
        # Line drawings lose nothing to a palette and shrink to a third.
        with Image.open(temporary) as full:
            few = full.convert("RGB").quantize(128)
        few.save(temporary, format=kind, pnginfo=mark)
    return path


def judged_models(result: StudyResult) -> list[str]:
    """Models that are no references; all models if there is no other."""
    own = [m for m in result.models if result.model_settings[m].get("role") != "reference"]
    return own or result.models


def line_of(result: StudyResult, model: str) -> dict[str, Any]:
    """Line of a model: that of a forecast, of an ensemble, or one of its own beyond the first."""
    singles = [name for name in result.models if name not in result.ensembles]
    first = (*singles[:1], *result.ensembles[:1])
    if model in first:
        return LINES["forecast" if model in singles else "ensemble"]
    others = [name for name in result.models if name not in first]
    return {**SERIES[2 + others.index(model) % (len(SERIES) - 2)], "marker": None}


def model_words(model: str) -> str:
    """Name of a model for legends.

    Examples
    --------
    >>> model_words("bayesian"), model_words("hold_last"), model_words("fir")
    ('Bayesian', 'hold last', 'FIR')
    """
    known = {"bayesian": "Bayesian", "fir": "FIR", "fir_ahead": "FIR, 2 T̂ ahead", "arx": "ARX"}
    return known.get(model, model.replace("_", " "))


def listed(models: Iterable[str]) -> str:
    """Names of models, one after the other."""
    return ", ".join(map(model_words, models))


def shown(channel: xr.DataArray) -> tuple[float, str]:
    """Factor to the unit in which a channel is shown, and its label for an axis."""
    factor, units = prefixed(channel.attrs.get("units", ""), channel.values)
    return factor, axis_label(str(channel.name), units, channel.attrs.get("long_name"))


def axis_label(name: str, units: str, long_name: str | None = None) -> str:
    r"""Label of a channel for an axis: words, symbol where it has one, and unit.

    Examples
    --------
    >>> axis_label("pitch_rate", "rad/s")
    'pitch rate\n$\\dot{\\theta}$ [rad/s]'
    >>> axis_label("pitch", "deg", "Trim angle (MRU-5)")
    'Trim angle (MRU-5)\n$\\theta$ [deg]'
    >>> axis_label("propeller_torque", "N m")
    'propeller torque\n[N m]'
    >>> axis_label("eta_us_fwd", "m").partition("\n$")[0]
    'wave elevation\nus fwd'
    """
    channel = canonical_channel(name)
    symbol = f"${channel.symbol}$ " if channel else ""
    words = plain_text(wrapped(long_name_of(name, long_name), WIDEST))
    return f"{words}\n{symbol}[{shown_unit(units) or '?'}]"


def wrapped(words: str, widest: int = NARROW) -> str:
    r"""Words in as few lines as fit, of lengths as equal as they can be.

    Examples
    --------
    >>> wrapped("force of the forward line"), wrapped("IRR_Hs0.06_Tp1.67_b")
    ('force of the\nforward line', 'IRR_Hs0.06_Tp1\n.67_b')
    """
    wraps = [
        textwrap.wrap(words, width, break_long_words=width == widest, break_on_hyphens=False)
        for width in range(1, widest + 1)
    ]
    lines = min((each for each in wraps if max(map(len, each), default=0) <= widest), key=len)
    return "\n".join(lines)


def short_label(channel: str) -> str:
    r"""Symbol of a channel for a crowded axis, else its name in lines.

    Examples
    --------
    >>> short_label("pitch_rate"), short_label("torque"), short_label("cost_in_$")
    ('$\\dot{\\theta}$', 'torque', 'cost in \\$')
    """
    known = canonical_channel(channel)
    return f"${known.symbol}$" if known else plain_text(wrapped(channel.replace("_", " ")))


def plain_text(words: str) -> str:
    r"""Escape a user's words for a figure, so that a dollar sign does not start a formula.

    Examples
    --------
    >>> plain_text("price [$/kWh]")
    'price [\\$/kWh]'
    """
    return words.replace("$", r"\$")


def prefixed(units: str, values: npt.ArrayLike) -> tuple[float, str]:
    """Factor and unit in which values are shown: angles in degrees, large forces with a prefix.

    So are large moments, pressures and powers, and responses of any of them.

    Examples
    --------
    >>> prefixed("N", 3.2e6), prefixed("N m", [20, -4500]), prefixed("m", 4500.0)
    ((1e-06, 'MN'), (0.001, 'kN m'), (1.0, 'm'))
    >>> prefixed("N/m", 2e5), prefixed("rad", 1.0)
    ((0.001, 'kN/m'), (57.29577951308232, 'deg'))
    """
    factor, units = displayed(units)
    if units.partition("/")[0] in _WITH_PREFIX:
        largest = np.nanmax(np.abs(values), initial=0.0)
        for prefix, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
            if largest >= size:
                return 1.0 / size, prefix + units
    return factor, units


def shown_unit(unit: str) -> str:
    """A unit as people read it.

    Examples
    --------
    >>> shown_unit("m/s^2"), shown_unit("N*m")
    ('m/s²', 'N·m')
    """
    return unit.replace("^2", "²").replace("^3", "³").replace("*", "·")
