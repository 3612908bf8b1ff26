"""Reading what people have: sound, movement, beats. Errors start with the file's name."""
