"""What the notebooks run on, and their tables as functions from RunProfile to DataFrame."""
