"""Units of coordinates: from where orbits go, not from how small the region is where they begin."""

import numpy as np
import pytest

from cellmap import discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.regions.extents import region_extent
from systems import magnetic_pendulum


def test_pendulums_with_tiny_velocities_come_to_the_same_magnets():
    """As those at rest do.  Both multipliers of each pair have the product exp(-damping period)."""
    strobe = stroboscopic_map(magnetic_pendulum(damping=0.2, period=2.0))
    places = np.array([[1.0, 0.2], [-0.6, 1.0], [-0.4, -1.0], [1.0, 0.0]])
    found = find_basins(strobe, np.hstack([places, np.full((4, 2), 1e-12)]), max_periods=300)
    assert found.labels.tolist() == [0, 1, 2, 0]
    assert [abs(a.multipliers[0]) for a in found.attractors] == pytest.approx([np.exp(-0.2)] * 3, abs=1e-9)


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e4)])
def test_units_follow_the_scale_of_the_motion(scale, shift):
    """A spiral in x and y, of which y has the values 1/2, 1/2, 1/4, 0, -1/8, ...; half of the orbits diverge in z."""

    def turned(s, p):
        x, y, z = (s[0] - shift) / scale, (s[1] - shift) / scale, s[2]
        return shift + scale * (0.5 * x - 0.5 * y), shift + scale * (0.5 * x + 0.5 * y), z * (1.5 if z > 0 else 0.5)

    places = shift + scale * np.array([[1.0, 0.0], [1.0, 1e-9]])
    states = np.hstack([np.repeat(places, 4, axis=0), np.tile([[-1.0], [-0.5], [0.5], [1.0]], (2, 1))])
    sizes = region_extent(discrete_map(turned, {}, ("x", "y", "z")), states)
    assert sizes[1:] == pytest.approx([0.625 * scale, 2.0], rel=1e-6)
