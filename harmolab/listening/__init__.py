"""Listening studies with real people: blind trials, answers that survive a crash, and analysis."""
