"""harmolab: is this motion in harmony with this music?

>>> from harmolab import score_clip, synthetic_clip
>>> score = score_clip(synthetic_clip("jive", seconds=30.0, seed=3))
>>> score.judgement.verdict
'You are on the beat: slow on it, fastest 195 ms after it.'

The public names stand in ``__init__.pyi``: here, in `harmolab.systems`, `harmolab.lab` and `harmolab.musician`. Each is
resolved on first use, so that ``import harmolab`` is quick and loads no plotting or training library.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
