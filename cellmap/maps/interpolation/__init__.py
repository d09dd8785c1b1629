"""Interpolated cell maps (Tongue and Gu 1988): tables of a point map, and look-ups in them."""
