"""Figures of the papers and of the notebooks: drawing on axes that are given."""
