"""Notebooks run and built into an offline report."""

MANIFEST = "manifest.json"  # beside the figures of a run
