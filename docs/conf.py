"""Sphinx settings; `sphinx-build -W -b html docs docs/_build/html` needs no network."""

import base64
import html
import io
import re
import sys
from importlib import metadata
from pathlib import Path

from docutils import nodes
from matplotlib import mathtext, rc_context
from matplotlib.font_manager import FontProperties

sys.path.insert(0, str(Path(__file__).parent))
import make_reference

for name, text in make_reference.generated():
    place = Path(__file__).parent / name
    place.parent.mkdir(exist_ok=True)
    if not place.exists() or place.read_text(encoding="utf-8") != text:
        place.write_text(text, encoding="utf-8")

project = "seakeep"
author = "The seakeep developers"
copyright = "The seakeep developers"
release = version = metadata.version("seakeep")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # pages with cells: the notebook and the gallery
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc sections state the types in words
autodoc_default_options = {"members": True}
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_preprocess_types = False
napoleon_use_rtype = False

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["style.css"]
html_math_renderer = "mathtext"
html_title = f"seakeep {release}"
html_show_sphinx = False
html_copy_source = False
exclude_patterns = ["_build"]
# The examples' pages link to files beside them; members of several classes share names.
suppress_warnings = ["myst.xref_missing", "ref.python"]


def formula(text):
    """Draw a formula with matplotlib: pages show it without network and without LaTeX."""
    picture = io.BytesIO()
    source = re.sub(r"\\mathcal (\w)", r"\\mathcal{\1}", " ".join(text.split()))
    for unknown, known in ((r"\#", "N"), (r"\|", r"\Vert "), (r"\tfrac12", r"\frac{1}{2}")):
        source = source.replace(unknown, known)
    style = {"svg.hashsalt": "seakeep", "mathtext.fontset": "stix", "svg.fonttype": "path"}
    try:
        with rc_context(style):
            depth = mathtext.math_to_image(
                f"${source}$", picture, prop=FontProperties(size=12.5), dpi=72, format="svg"
            )
    except ValueError:  # what matplotlib cannot set is shown as it was written
        return f"<code>{html.escape(text)}</code>"
    data = base64.b64encode(picture.getvalue()).decode()
    return (
        f'<img class="formula" alt="{html.escape(text, quote=True)}" '
        f'style="vertical-align:{-1.33 * depth:.1f}px" src="data:image/svg+xml;base64,{data}">'
    )


def visit_inline(writer, node):
    writer.body.append(formula(node.astext()))
    raise nodes.SkipNode


def visit_block(writer, node):
    writer.body.append(f'<div class="formula">{formula(node.astext())}</div>')
    raise nodes.SkipNode


def setup(app):
    """Register the renderer of formulas."""
    app.add_html_math_renderer("mathtext", (visit_inline, None), (visit_block, None))
