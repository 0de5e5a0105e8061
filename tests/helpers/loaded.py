"""Scripts that lie beside the package."""

import runpy
from types import SimpleNamespace


def loaded(path):
    """Names of a script, which does not run as one."""
    return SimpleNamespace(**runpy.run_path(str(path)))
