from .auto_files import save_auto as save_auto
from .datasets import to_xarray as to_xarray
from .records import from_xarray as from_xarray
from .tables import to_dataframe as to_dataframe
