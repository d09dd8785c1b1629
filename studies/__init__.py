"""Studies: one script a figure, run by ``python -m studies NAME``."""
