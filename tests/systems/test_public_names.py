"""What `systems` offers: loaded when it is used first, and under names that no module hides."""

import pkgutil
import subprocess
import sys

import pytest

import systems
import systems.lab


@pytest.mark.parametrize("package", [systems, systems.lab], ids=lambda package: package.__name__)
def test_no_module_has_the_name_of_something_public(package: object) -> None:
    """Importing such a module would put it in the place of the function."""
    modules = {m.name for m in pkgutil.iter_modules(package.__path__)}  # type: ignore[attr-defined]
    assert not (set(package.__all__) - {"lab"}) & modules  # type: ignore[attr-defined]


def test_the_package_is_loaded_when_it_is_used() -> None:
    """Neither its modules nor SciPy and numba are loaded before they are needed, and tracking alone needs an extra."""
    code = """
import sys
import systems, systems.lab
loaded = {m for m in sys.modules if m.startswith("systems.")}
assert loaded == {"systems.lab"}, loaded
from systems import scene, Pendulum, Gravity
scene(Pendulum(1.0), Gravity(9.8), period=1.0).derivative(0.0, (0.1, 0.0))
assert not {"scipy", "numba", "h5py", "matplotlib", "skimage", "systems.averaging", "systems.wells"} & set(sys.modules)
sys.modules["skimage"] = None
from systems.lab import Tracks, film_at_rate, fit_damping, recover_drive
try:
    systems.lab.track_markers
except ModuleNotFoundError as error:
    assert "scikit-image: pip install 'cellmap-dynamics[lab]'" in str(error), error
else:
    raise AssertionError("tracking needs it")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
