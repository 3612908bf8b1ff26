"""The laboratory around the core: comparisons, evaluation, explanations, labs, pictures, user studies, the report.

The public names stand in ``__init__.pyi`` and are resolved on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
