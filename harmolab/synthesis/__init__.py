"""Music in, a dance of any length out."""

from harmolab.synthesis.dance import synthesize_dance

__all__ = ["synthesize_dance"]
