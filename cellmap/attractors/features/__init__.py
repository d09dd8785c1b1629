"""Attractors told apart by features of orbits that their user computes."""
