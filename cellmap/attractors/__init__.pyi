from .search import find_attractors as find_attractors
