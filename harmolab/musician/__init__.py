"""Audio to Body Dynamics (Shlizerman et al. 2018): the points of a pianist or violinist from the sound alone.

The public names stand in ``__init__.pyi`` and are resolved on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
