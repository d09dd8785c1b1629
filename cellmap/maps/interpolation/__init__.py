"""Interpolated cell maps (Tongue and Gu 1988): B-spline interpolation of a point map."""
