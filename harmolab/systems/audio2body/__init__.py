"""Audio to Body Dynamics (Shlizerman et al. 2018): sound in, the points of a pianist or a violinist out."""
