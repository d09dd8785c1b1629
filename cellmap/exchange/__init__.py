"""Results for other programs: labelled arrays of xarray (netCDF), tables of pandas, HTML, files of AUTO and XPP.

xarray, h5netcdf and pandas are optional: ``pip install "cellmap-dynamics[xarray]"`` installs them.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
