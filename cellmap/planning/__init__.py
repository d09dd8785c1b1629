"""Plans: the way to a picture that reaches a wanted accuracy in the least time."""

from .options import Option as Option
from .planner import AccuracyWarning as AccuracyWarning
from .planner import plan as plan
from .plans import Outcome as Outcome
from .plans import Plan as Plan
