"""The recommended score: in time? where in the beat? and one verdict in words."""
