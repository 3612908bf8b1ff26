"""One's own dance beside a song: offset, findings, verdict, page."""
