"""Data-driven models of vessels in waves: Hankel dynamic mode decomposition with control.

``__init__.pyi`` lists the public names. A module is imported when one of its names is first used.
"""

from importlib import metadata

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = metadata.version("seakeep")
