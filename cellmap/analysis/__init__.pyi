from . import boundary as boundary
from . import fractal as fractal
from . import resilience as resilience
from .statistics import Fit as Fit
from .statistics import binomial_interval as binomial_interval
from .statistics import fit_line as fit_line
