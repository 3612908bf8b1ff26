"""Training: phases in one visible loop on Lightning Fabric, checkpoints that survive a kill, a history to plot."""

from harmolab.training.loop import Phase, Player, fit, make_fabric

__all__ = ["Phase", "Player", "fit", "make_fabric"]
