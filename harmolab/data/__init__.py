"""Corpora: folders of recordings, those of Tang et al. among them, and summaries of files and folders."""
