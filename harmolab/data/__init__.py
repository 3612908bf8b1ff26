"""Folders of recordings, and synthetic ones."""

from __future__ import annotations
