"""One look for all figures: colours that survive grey print and colour-blind readers."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.campaign.settings import long_name_of
from seakeep.conventions import canonical_channel
from seakeep.errors import RequestError
from seakeep.files import MARK, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "COLOURS",
    "LINES",
    "PALETTE",
    "THIN",
    "axis_label",
    "figure_style",
    "new_figure",
    "plain_text",
    "prefixed",
    "save_figure",
    "shown_unit",
]

PALETTE = {
    "black": "#000000",
    "vermilion": "#D55E00",
    "blue": "#0072B2",
    "green": "#009E73",
    "pink": "#CC79A7",
    "amber": "#E69F00",
    "sky": "#56B4E9",
    "slate": "#56606B",
    "brown": "#8C564B",
    "violet": "#9467BD",
    "grey": "#999999",
    "pale": "#BBBBBB",
    "light": "#D9D9D9",
    "blush": "#FDEEE4",
}
"""From the palette of Okabe and Ito, their greys differ too; then two more colours, and tints."""

COLOURS = {
    "measured": PALETTE["black"],
    "forecast": PALETTE["vermilion"],
    "ensemble": PALETTE["blue"],
    "input": PALETTE["slate"],
    "start": PALETTE["green"],
}
"""By what a line shows."""

LINES: dict[str, dict[str, Any]] = {
    "measured": {"color": COLOURS["measured"], "linewidth": 1.6, "linestyle": "-"},
    "forecast": {"color": COLOURS["forecast"], "linewidth": 1.2, "linestyle": (0, (4, 1.5))},
    "ensemble": {
        "color": COLOURS["ensemble"],
        "linewidth": 1.3,
        "linestyle": (0, (4, 2.5, 1, 2.5)),
    },
    "input": {"color": COLOURS["input"], "linewidth": 0.9, "linestyle": "-"},
}
"""Lines differ in dash and width as well as in colour."""

THIN: dict[str, Any] = {**LINES["measured"], "linewidth": 0.8}
"""Measured, between a band and its mean: a band is often little wider than a line."""

WIDEST = 18
"""Letters of a label on one line: what the height of a panel holds."""

_WITH_PREFIX = ("N", "N m", "Pa", "W")
"""Units whose values run into millions at full scale."""

_RC: Any = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": PALETTE["light"],
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "figure.dpi": 110,  # of layout and picture alike: what is measured for one serves the other
    "svg.fonttype": "none",
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in our style, without touching anybody's global settings."""
    try:
        import matplotlib as mpl
    except ImportError as error:
        raise RequestError(
            "figures need matplotlib, which is not installed. "
            "Install it with: pip install 'seakeep[figures]'"
        ) from error
    with mpl.rc_context(_RC):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, in inches; draw on it inside :func:`figure_style`."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, path: Path, dpi: float | None = None) -> Path:
    """Write a figure to a temporary name and rename it; the suffix decides the format."""
    with figure_style(), replacing(path) as temporary:
        kind = path.suffix.removeprefix(".")
        if kind != "png":
            figure.savefig(temporary, format=kind, metadata={"Creator": f"{MARK}: figure"})
            return path
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image, PngImagePlugin  # comes with matplotlib

        figure.set_dpi(_RC["figure.dpi"] if dpi is None else dpi)
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        full = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        # Line drawings lose nothing to a palette and shrink to a third.
        mark = PngImagePlugin.PngInfo()
        mark.add_text("Software", f"{MARK}: figure")
        full.quantize(128).save(temporary, format=kind, pnginfo=mark)
    return path


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
    lines = "\n".join(_balanced(plain_text(long_name_of(name, long_name))))
    return f"{lines}\n{symbol}[{shown_unit(units) or '?'}]"


def plain_text(words: str) -> str:
    r"""Escape a user's words for a figure, so that a dollar sign does not start a formula.

    Examples
    --------
    >>> plain_text("price [$/kWh]")
    'price [\\$/kWh]'
    """
    return words.replace("$", r"\$")


def prefixed(units: str, largest: float) -> tuple[float, str]:
    """Factor and unit in which a large force, moment, pressure or power is shown.

    Examples
    --------
    >>> prefixed("N", 3.2e6), prefixed("N m", 4500.0), prefixed("m", 4500.0)
    ((1e-06, 'MN'), (0.001, 'kN m'), (1.0, 'm'))
    """
    if units in _WITH_PREFIX:
        for prefix, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
            if largest >= size:
                return 1.0 / size, prefix + units
    return 1.0, units


def shown_unit(unit: str) -> str:
    """A unit as people read it.

    Examples
    --------
    >>> shown_unit("m/s^2"), shown_unit("N*m")
    ('m/s²', 'N·m')
    """
    return unit.replace("^2", "²").replace("^3", "³").replace("*", "·")


def _balanced(words: str) -> list[str]:
    """Wrap into as few lines as fit, of lengths as equal as they can be."""
    lines = textwrap.wrap(words, WIDEST, break_on_hyphens=False)
    for width in range(1, WIDEST):
        narrower = textwrap.wrap(words, width, break_long_words=False, break_on_hyphens=False)
        if len(narrower) == len(lines) and max(map(len, narrower)) <= WIDEST:
            return narrower
    return lines
