"""Sphinx settings; `sphinx-build -W -b html docs docs/_build/html` needs no network."""

from importlib import metadata

project = "seakeep"
author = "The seakeep developers"
copyright = "The seakeep developers"
release = version = metadata.version("seakeep")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
]
myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc sections state the types in words
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_preprocess_types = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"seakeep {release}"
html_show_sphinx = False
html_copy_source = False
exclude_patterns = ["_build"]
suppress_warnings = ["myst.xref_missing"]  # the examples' pages link to files beside them
