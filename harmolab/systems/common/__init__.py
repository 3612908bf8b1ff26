"""What systems share: units, motion code, audio features, layers, training, weights. It imports no system."""
