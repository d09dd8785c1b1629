"""Kinds of attractors: each module tells from the ends of orbits on which of one kind they are."""
