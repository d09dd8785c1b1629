"""Shortcuts of the search, which change how long it takes and no label."""
