"""Data-driven models of vessels in waves: Hankel dynamic mode decomposition with control.

The public names are listed in ``__init__.pyi``; each room is imported when a name of it is used.
"""

from importlib import metadata

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = metadata.version("seakeep")
