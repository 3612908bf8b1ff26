"""The body: its joints, its movement, its rotations."""
