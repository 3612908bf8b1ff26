"""HarmoGAN, the system of the harmony paper."""

from harmolab.systems.harmogan.system import HarmoGAN

__all__ = ["HarmoGAN"]
