"""Pictures and videos of a dance."""
