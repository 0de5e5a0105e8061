"""How models and settings show themselves in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any


def text_html(text: str) -> str:
    """Text as it stands: what ``_repr_html_`` of a model gives."""
    return f'<pre style="white-space: pre-wrap">{escape(text)}</pre>'


def settings_html(name: str, settings: Mapping[str, Any]) -> str:
    """Settings as a table: what ``_repr_html_`` of a spec gives.

    Examples
    --------
    >>> settings_html("HankelDMDc", {"ridge": 1.0})
    '<table><caption>HankelDMDc</caption><tr><th>ridge</th><td>1.0</td></tr></table>'
    """
    rows = "".join(
        f"<tr><th>{escape(key)}</th><td>{escape(str(value))}</td></tr>"
        for key, value in settings.items()
    )
    return f"<table><caption>{escape(name)}</caption>{rows}</table>"
