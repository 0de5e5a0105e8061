"""Studies, from campaign to judgement: settings, plan, run (one file per unit), judge.

The public names are listed in ``__init__.pyi``; a module is imported when a name of it is used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
