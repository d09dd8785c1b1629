"""Set-oriented methods: boxes, their images, and what follows from them alone."""

from .boxes import BoxSet as BoxSet
from .exponents import box_ftle as box_ftle
from .hybrid import SubdivisionSearch as SubdivisionSearch
from .hybrid import find_attractors_by_subdivision as find_attractors_by_subdivision
from .images import box_image as box_image
from .images import box_transitions as box_transitions
from .invariant import chain_recurrent_set as chain_recurrent_set
from .invariant import maximal_invariant_set as maximal_invariant_set
from .invariant import relative_attractor as relative_attractor
from .manifolds import stable_set as stable_set
from .manifolds import unstable_set as unstable_set
from .morse import MorseGraph as MorseGraph
from .morse import morse_graph as morse_graph
from .transfer import AlmostInvariant as AlmostInvariant
from .transfer import Cycle as Cycle
from .transfer import TransferOperator as TransferOperator
from .transfer import transfer_operator as transfer_operator
