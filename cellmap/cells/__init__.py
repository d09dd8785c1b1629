"""Cell mapping: all points of a cell go where samples of it go (Hsu 1980, 1981)."""

from .chain import CellChain as CellChain
from .chain import CellClass as CellClass
from .generalized import generalized_cell_mapping as generalized_cell_mapping
from .mapping import CellMapping as CellMapping
from .mapping import simple_cell_mapping as simple_cell_mapping
