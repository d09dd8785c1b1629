"""Legends of figures."""

from matplotlib.axes import Axes


def legend_of(ax: Axes) -> list[str]:
    return [t.get_text() for t in ax.get_legend().get_texts()]
