"""One's own dance beside a song: offset, findings, verdict, page."""

from __future__ import annotations
