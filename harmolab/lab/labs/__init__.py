"""One lab for each choice of the score."""

from __future__ import annotations
