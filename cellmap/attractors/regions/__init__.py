"""Regions around attractors that orbits do not leave: ellipsoids, tubes, boxes and hulls."""
