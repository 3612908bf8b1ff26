"""Notebooks run and built into an offline report."""
