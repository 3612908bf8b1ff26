"""Ren et al. 2020, "Self-supervised Dance Video Synthesis Conditioned on Music", re-implemented."""

from harmolab.systems.ren2020.train import Ren2020

__all__ = ["Ren2020"]
