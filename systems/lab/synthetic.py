"""Synthetic measurements, on which the tools of the laboratory are tried: see :mod:`systems.synthetic`."""

from ..synthetic.appearance import Bar as Bar
from ..synthetic.appearance import Camera as Camera
from ..synthetic.appearance import Look as Look
from ..synthetic.appearance import Spot as Spot
from ..synthetic.records import pivot_acceleration as pivot_acceleration
from ..synthetic.records import record_acceleration as record_acceleration
from ..synthetic.rendering import Recording as Recording
from ..synthetic.rendering import render_film as render_film
from ..synthetic.stability_experiment import measure_least_amplitudes as measure_least_amplitudes
