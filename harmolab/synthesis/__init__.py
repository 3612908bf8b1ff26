"""Music in, a dance of any length out."""
