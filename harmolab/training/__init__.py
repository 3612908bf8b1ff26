"""Training of the generators: visible loops on Lightning Fabric, checkpoints that survive a kill, a history to plot."""

from harmolab.training.run import make_fabric, train_harmogan

__all__ = ["make_fabric", "train_harmogan"]
