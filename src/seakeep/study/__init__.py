"""Studies: every model, trained on every training set, judged in every test window.

``__init__.pyi`` lists the public names. A module is imported when one of its names is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
