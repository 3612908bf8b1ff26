"""Work that notebooks share: material, measurements, tables and charts. It is no part of the package.

The names that notebooks use stand in ``__init__.pyi`` and are resolved on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
