"""Reference systems, one factory each; every factory has defaults for all of its parameters."""

from .dimensionless import dimensionless_parameters as dimensionless_parameters
from .dimensionless import dimensionless_pendulum as dimensionless_pendulum
from .dimensionless import physical_parameters as physical_parameters
from .duffing import two_well_duffing as two_well_duffing
from .forced_pendulum import forced_pendulum as forced_pendulum
from .henon import henon_map as henon_map
from .pendulum import driven_pendulum as driven_pendulum
