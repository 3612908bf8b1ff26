"""Music2Dance (Zhuang et al. 2020): a WaveNet that dances frame by frame, with music and dance beside it."""

from harmolab.systems.music2dance.system import Music2Dance

__all__ = ["Music2Dance"]
