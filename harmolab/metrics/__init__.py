"""The field's other measures: movement against beats, movement alone, sets of dances, likeness to recorded dancers."""
