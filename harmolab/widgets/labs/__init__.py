"""Labs: the choices of a score on controls, and one picture that shows what they do."""
