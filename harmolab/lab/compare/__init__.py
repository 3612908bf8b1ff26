"""Scores over a corpus: windows, AUC, many clips at once."""
