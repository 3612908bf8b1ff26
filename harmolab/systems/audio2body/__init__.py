"""Audio to Body Dynamics (Shlizerman et al. 2018): the points of a pianist or violinist from the sound alone."""

from harmolab.systems.audio2body.system import Audio2Body

__all__ = ["Audio2Body"]
