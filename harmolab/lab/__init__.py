"""The laboratory around the core: comparisons, timing, user studies, pictures, widgets, experiments, the report."""
