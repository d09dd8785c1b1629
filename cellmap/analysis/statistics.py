"""Line fits and confidence intervals for all measures."""

from .._lib.binomial import binomial_interval as binomial_interval
from .._lib.fit import Fit as Fit
from .._lib.fit import fit_line as fit_line
