"""Tables of the notebooks."""
