"""Training: phases in one visible loop on Lightning Fabric, checkpoints that survive a kill, a history to plot."""
