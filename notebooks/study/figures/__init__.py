"""Figures of the notebooks, drawn from tables."""
