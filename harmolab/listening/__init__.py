"""Listening studies with real people: trials that hide what they test, answers that survive a crash, and analysis."""
