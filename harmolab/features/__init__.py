"""What models and metrics are given of music and motion: arrays in, arrays out, and no model here."""
