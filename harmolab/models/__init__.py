"""Torch models: the generator and its discriminators, the pose network, losses, relaxed harmony."""
