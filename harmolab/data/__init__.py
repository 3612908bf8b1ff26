"""Folders of recordings, and synthetic ones."""
