"""Controls and pictures for notebooks; static viewers show the picture."""
