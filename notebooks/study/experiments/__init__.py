"""Experiments of the notebooks."""
