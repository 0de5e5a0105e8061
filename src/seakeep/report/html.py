"""Pages from templates: self-contained, everything escaped that is not ours."""

from __future__ import annotations

import base64
import re
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from seakeep.report.tables import shade

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["inline_picture", "inline_svg", "rendered"]


def rendered(template: str, **content: Any) -> str:
    """Page of a template of :mod:`seakeep.report.templates`."""
    return _environment().get_template(template).render(**content)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("seakeep.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["source"] = _source
    made.filters["shade"] = shade
    made.filters["breakable"] = lambda text: escape(text).replace("_", Markup("_<wbr>"))
    made.filters["minus"] = lambda text: re.sub(r"(?<![\w)])-(?=\d)", "−", text)
    return made


def _source(name: str) -> Markup:
    """Style sheet or script of ours, as it stands."""
    folder = resources.files("seakeep.report").joinpath("templates")
    return Markup(folder.joinpath(name).read_text("utf-8"))


def inline_svg(text: str, name: str, words: str) -> Markup:
    """Turn an SVG file into an element that may stand inside a page beside others."""
    text = text[text.index("<svg") :]
    label = f"title-{name}"
    title = f'role="img" aria-labelledby="{label}"><title id="{label}">{escape(words)}</title>'
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"<title>.*?</title>", "", text, flags=re.S)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = re.sub(r"url\(#", f"url(#{name}-", text)
    return Markup(text.replace(">", f" {title}", 1))


def inline_picture(png: bytes, words: str) -> Markup:
    """Element ``<img>`` that holds a picture."""
    encoded = base64.b64encode(png).decode("ascii")
    return Markup(f'<img alt="{escape(words)}" src="data:image/png;base64,{encoded}">')
