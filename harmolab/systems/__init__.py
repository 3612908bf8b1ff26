"""Systems that make dances from music: how to find one, load one, let it dance, and train one.

The public names stand in ``__init__.pyi`` and are resolved on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
