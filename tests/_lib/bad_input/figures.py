"""What a figure shows, in words and numbers: where artists of each kind are, how they look, and what is written."""

from collections.abc import Iterable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba_array
from matplotlib.lines import Line2D

LOOKS = "linewidth linestyle marker markersize alpha zorder hatch array clim extent".split()
COLOURS = "color facecolor edgecolor markerfacecolor".split()


def described() -> dict[str, list[float]]:
    """Describe all figures: for each text 1, and for each property of each kind of artist a few numbers."""
    found: dict[str, list[float]] = {}
    for number in plt.get_fignums():
        figure = plt.figure(number)
        found[f"{number} inches"] = figure.get_size_inches().tolist()
        for place, ax in enumerate(figure.axes):
            found |= {f"{number}.{place} {key}": values for key, values in _of_axes(ax).items()}
    return found


def _of_axes(ax: Axes) -> dict[str, list[float]]:
    legend = ax.get_legend()
    texts = [
        ax.get_title(),
        ax.get_xlabel(),
        ax.get_ylabel(),
        ax.get_xscale(),
        ax.get_yscale(),
        f"{ax.patch.get_hatch()}",
    ]
    texts += [text.get_text() for text in (*ax.texts, *(legend.get_texts() if legend else ()))]
    found = {f"says {text}": [1.0] for text in texts}
    found["limits"] = [*map(float, (*ax.get_xlim(), *ax.get_ylim(), bool(legend and legend.get_frame_on())))]
    handles = legend.legend_handles if legend else ()
    for kind, artists in (
        *(("line", ax.lines), ("collection", ax.collections), ("image", ax.images), ("patch", ax.patches)),
        ("text", ax.texts), ("key", handles),
    ):  # fmt: skip
        found |= _summary(f"{kind} place", map(_place, artists))
        for name in LOOKS:
            found |= _summary(f"{kind} {name}", (getattr(a, f"get_{name}", str)() for a in artists))
        for name in COLOURS:
            found |= _summary(f"{kind} {name}", (to_rgba_array(getattr(a, f"get_{name}", tuple)()) for a in artists))
    return found


def _place(artist: Artist) -> Any:
    if isinstance(artist, Line2D):
        return artist.get_xydata()
    if isinstance(artist, Collection):
        return np.concatenate([artist.get_offsets(), *(path.vertices for path in artist.get_paths())])
    return artist.get_path().vertices if hasattr(artist, "get_path") else getattr(artist, "xy", ())


def _summary(name: str, values: Iterable[Any]) -> dict[str, list[float]]:
    """Return of words one entry each, and of numbers how many there are and two means that know their order."""
    found: dict[str, list[float]] = {}
    numbers = [np.zeros(0)]
    for value in values:
        if isinstance(value, str) or value is None:
            found |= {f"{name} {value}": [1.0]} if value else {}
        else:
            numbers.append(np.nan_to_num(np.ma.filled(np.ma.asarray(value, float), -1.0), nan=-1.0).ravel())
    every = np.concatenate(numbers)
    means = (every.mean(), (every * np.linspace(0.0, 1.0, every.size)).mean()) if every.size else ()
    return found | ({name: [float(every.size), *(float(f"{mean:.5g}") for mean in means)]} if every.size else {})
