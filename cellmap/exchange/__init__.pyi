from .auto_files import save_auto as save_auto
from .datasets import to_xarray as to_xarray
from .ode_files import OdeFile as OdeFile
from .ode_files import read_ode as read_ode
from .records import from_xarray as from_xarray
from .tables import to_dataframe as to_dataframe
