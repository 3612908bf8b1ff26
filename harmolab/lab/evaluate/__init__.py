"""Tables of what a system's dances reach."""
