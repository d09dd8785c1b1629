"""Free swings: their envelopes, what damps them, and parameters from whole motions."""
