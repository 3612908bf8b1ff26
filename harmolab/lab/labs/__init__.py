"""One lab for each choice of the score."""
