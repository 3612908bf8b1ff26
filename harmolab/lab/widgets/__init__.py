"""Labs and the player."""
