"""Motions whose time is bent until their beats meet the music's."""
