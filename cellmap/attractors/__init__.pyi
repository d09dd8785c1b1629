from .clustering import OrbitClusters as OrbitClusters
from .clustering import cluster_orbits as cluster_orbits
from .search import find_attractors as find_attractors
