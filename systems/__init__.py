"""Reference systems, one factory each; every factory has defaults for all of its parameters."""

from .compound import compound_pendulum as compound_pendulum
from .dimensionless import dimensionless_parameters as dimensionless_parameters
from .dimensionless import dimensionless_pendulum as dimensionless_pendulum
from .dimensionless import from_stability_coordinates as from_stability_coordinates
from .dimensionless import physical_parameters as physical_parameters
from .dimensionless import stability_coordinates as stability_coordinates
from .double_pendulum import chain_pendulum as chain_pendulum
from .double_pendulum import double_pendulum as double_pendulum
from .double_pendulum import triple_pendulum as triple_pendulum
from .duffing import duffing_oscillator as duffing_oscillator
from .duffing import moon_li_duffing as moon_li_duffing
from .duffing import two_well_duffing as two_well_duffing
from .duffing import ueda_oscillator as ueda_oscillator
from .forced_pendulum import forced_pendulum as forced_pendulum
from .grebogi import grebogi_ott_yorke_map as grebogi_ott_yorke_map
from .helmholtz import helmholtz_oscillator as helmholtz_oscillator
from .henon import henon_map as henon_map
from .hill import hill_equation as hill_equation
from .hill import mathieu_equation as mathieu_equation
from .logistic import logistic_map as logistic_map
from .magnetic_pendulum import magnetic_pendulum as magnetic_pendulum
from .mcdonald import mcdonald_map as mcdonald_map
from .pendulum import driven_pendulum as driven_pendulum
from .standard import standard_map as standard_map
from .stick_slip import stick_slip_oscillator as stick_slip_oscillator
from .van_der_pol import van_der_pol_oscillator as van_der_pol_oscillator
