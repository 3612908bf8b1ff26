"""Audio to Body Dynamics (Shlizerman et al. 2018): the points of a pianist or violinist from the sound alone."""
