"""Tools for packages built on cellmap: checks of arguments, random numbers, files, and functions over arrays."""

from .._compiled.codegen.rebind import over_arrays as over_arrays
from .._lib.checks import check_length as check_length
from .._lib.checks import claim_memory as claim_memory
from .._lib.checks import finite_number as finite_number
from .._lib.checks import finite_points as finite_points
from .._lib.checks import monotone_values as monotone_values
from .._lib.checks import one_of as one_of
from .._lib.checks import one_point as one_point
from .._lib.checks import shown as shown
from .._lib.checks import text as text
from .._lib.checks import whole_number as whole_number
from .._lib.files import StoreError as StoreError
from .._lib.files import as_path as as_path
from .._lib.files import as_target as as_target
from .._lib.files import written_whole as written_whole
from .._lib.randomness import Rng as Rng
from .._lib.randomness import random_numbers as random_numbers
from .._lib.threads import progress_bar as progress_bar
