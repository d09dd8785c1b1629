from .continued import continue_attractors as continue_attractors
from .features.clustering import OrbitClusters as OrbitClusters
from .features.clustering import cluster_orbits as cluster_orbits
from .search import find_attractors as find_attractors
from .settling.labels import Label as Label
