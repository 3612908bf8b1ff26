"""Tools around the score: comparing and evaluating dances, explanations, pictures, labs, listening studies, videos.

The public names stand in ``__init__.pyi`` and are resolved on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
