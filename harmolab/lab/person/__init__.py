"""One figure of a person for all pictures: the parts of the body, the camera, and outlines that any painter fills."""
