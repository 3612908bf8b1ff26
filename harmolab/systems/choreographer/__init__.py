"""The choreographer: recorded beats, chosen by dynamic programming and laid on the beats of a song."""

from harmolab.systems.choreographer.generate import Choreographer

__all__ = ["Choreographer"]
