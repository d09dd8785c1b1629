"""Attractors distinguished by features of orbits that their user computes."""
