"""Regions around attractors that orbits do not leave: ellipsoids, tubes and boxes."""
