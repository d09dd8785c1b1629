"""Iteration of orbits until each has come to an attractor, or has ended."""
