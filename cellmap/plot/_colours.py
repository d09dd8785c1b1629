"""Colours of attractors, labels and initial conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.colors import is_color_like, to_rgb

from .._lib.checks import check_mapping, shown
from ..attractors.settling.labels import Label

Colour = tuple[float, float, float]

COLOURS = (
    *("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442"),
    *("#5C005C", "#0000B8", "#990A00", "#AD00FF", "#70F5AD", "#5C4770", "#A37AFF"),
    *("#C2E0FF", "#995233", "#523DCC", "#85B87A", "#700029", "#3D1485"),
)
"""The seven colours of Okabe and Ito (2008), then others that are each as far as possible from those before it and from
white, greys and black, for normal and for red-, green- and blue-blind eyes (distances in Ottosson's Oklab, 2020; eyes
after Machado, Oliveira, Fernandes 2009)."""

CODE_COLOURS: dict[int, str] = {
    Label.ESCAPED: "0.72",
    Label.DIVERGED: "0.45",
    Label.UNDECIDED: "black",
    Label.NO_RETURN: "0.24",
    Label.UNLABELLED: "white",
    Label.OUT_OF_STEPS: "#6b4423",
    Label.DOUBTFUL: "#8a8a00",
    Label.ENDED: "#bb0088",
}
"""Colours of the labels that are not attractors: escaped, diverged, undecided, not returned, unlabelled, out of
steps, doubtful, ended (paler for further ends)."""


def colour_of(number: int) -> Colour:
    """Return the colour of an attractor or an orbit: one of COLOURS, paler in each further pass through them."""
    rounds, place = divmod(number, len(COLOURS))
    colour = 1.0 - (1.0 - np.array(to_rgb(COLOURS[place]))) * 0.55**rounds
    return to_rgb(tuple(colour))


def chosen_colours(colours: Mapping[Any, Any] | None) -> Mapping[Any, Any]:
    """Check colours that are given for some of what is drawn."""
    chosen = {} if colours is None else colours
    check_mapping("colours", chosen, "to colours of matplotlib")
    if not all(map(is_color_like, chosen.values())):
        raise ValueError(f"colours={shown(colours)}: give colours of matplotlib")
    return chosen


def one_colour(colour: Any, default: Any) -> Any:
    """Check the argument of that name."""
    if colour is None:
        return default
    if not is_color_like(colour):
        raise TypeError(f"colour={shown(colour)}: give a colour of matplotlib, such as 'black' or '#0072B2'")
    return colour


def label_colour(label: int) -> Colour:
    """Return the colour of a label."""
    if label >= 0:
        return colour_of(label)
    colour = 1.0 - (1.0 - np.array(to_rgb(CODE_COLOURS[max(label, Label.ENDED)]))) * 0.7 ** max(0, Label.ENDED - label)
    return to_rgb(tuple(colour))


def label_colours(labels: Iterable[int], colours: Mapping[int, Any] | None = None) -> dict[int, Colour]:
    """Return the colours of labels, some of which may be given."""
    chosen = chosen_colours(colours)
    return {label: to_rgb(chosen.get(label, label_colour(label))) for label in labels}
