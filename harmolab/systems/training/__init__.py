"""Shared by all systems: units, motion code, audio features, layers, training, weights. It imports no system."""
