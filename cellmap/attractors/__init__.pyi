from .continued import continue_attractors as continue_attractors
from .features.clustering import OrbitClusters as OrbitClusters
from .features.clustering import cluster_orbits as cluster_orbits
from .labels import Label as Label
from .search import find_attractors as find_attractors
