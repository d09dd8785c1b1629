"""One chart of which function answers which question, with links to the pages of the reference."""

from __future__ import annotations

from html import escape

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

HAVE = {
    "equations with a periodic force": "ForcedSystem",
    "a map": "discrete_map",
    "autonomous equations and a surface": "section_map",
}
MAP = ("stroboscopic_map", "interpolated_map")
WANT = {
    "How does it move?": "trajectory maps.integrate plot.animate",
    "Which attractors are there?": "find_attractors attractors.cluster_orbits",
    "Where does each initial condition go?": "find_basins basins.refine_basins basins.classify_by_features",
    "Is that right?": "Basins.verify certify plan",
    "How fractal are the boundaries?": (
        "analysis.fractal.uncertainty_exponent analysis.fractal.basin_entropy analysis.fractal.wada_merging"
    ),
    "How fractal are the attractors?": (
        "analysis.fractal.correlation_dimension analysis.fractal.box_dimension analysis.fractal.kaplan_yorke_dimension"
    ),
    "What lies on the boundary?": (
        "analysis.boundary.saddle_manifold analysis.boundary.edge_orbit analysis.boundary.chaotic_saddle"
    ),
    "Which disturbances does it survive?": (
        "analysis.resilience.basin_stability analysis.resilience.minimal_fatal_shock analysis.resilience.node_stability"
    ),
    "Is it chaotic?": "lyapunov_spectrum orbits.zero_one_test orbits.finite_time_exponents",
    "Which orbits exist, stable or not?": "find_periodic_orbits bifurcations.find_branches",
    "What changes with a parameter?": "bifurcation_diagram basins.continue_basins continue_orbit",
    "What changes with two?": "stability_map bifurcations.continue_bifurcation bifurcations.attractor_atlas",
    "What do sets of states do?": (
        "sets.generalized_cell_mapping sets.find_attractors_by_subdivision sets.transfer_operator"
    ),
}
ROW, TOP, LEFT, WIDTH = 46, 40, 330, 1060
STYLE = (
    ".chart text{fill:var(--pst-color-text-base,#222);font:14px sans-serif}"
    ".chart a text{fill:var(--pst-color-link,#06c);font:13px monospace}"
    ".chart rect{fill:none;stroke:var(--pst-color-border,#999);rx:6}"
    ".chart path{fill:none;stroke:var(--pst-color-text-muted,#888)}.chart .head{font-weight:bold}"
)


def _link(name: str, x: float, y: float, root: str) -> str:
    page, _, member = (name, "", "") if not name.startswith("Basins.") else ("Basins", ".", name)
    anchor = f"#cellmap.{member}" if member else ""
    shown = escape(name.removeprefix("analysis."))
    return f'<a href="{root}auto/api/cellmap.{page}.html{anchor}"><text x="{x}" y="{y}">{shown}</text></a>'


def chart(root: str = "") -> str:
    """Return the chart as SVG; `root` leads from its page to the top of the site."""
    height = TOP + ROW * len(WANT) + 10
    middle = TOP + ROW * len(WANT) / 2
    parts = [f'<text class="head" x="10" y="22">You have</text><text class="head" x="{LEFT}" y="22">You ask</text>']
    for k, (what, name) in enumerate(HAVE.items()):
        y = middle - 150 + 70 * k
        parts.append(f'<rect x="5" y="{y - 20}" width="290" height="52"/><text x="15" y="{y}">{what}</text>')
        parts.append(_link(name, 15, y + 20, root))
    parts.append(f'<rect x="5" y="{middle + 80}" width="290" height="74"/>')
    parts.append(f'<text x="15" y="{middle + 100}">which become a map, exact or interpolated</text>')
    parts += [_link(name, 15, middle + 120 + 20 * k, root) for k, name in enumerate(MAP)]
    parts.append(f'<path d="M150 {middle + 42} V{middle + 76}"/>')
    for k, (question, names) in enumerate(WANT.items()):
        y = TOP + ROW * k
        parts.append(f'<path d="M295 {middle + 117} H308 V{y + 18} H{LEFT - 5}"/>')
        parts.append(f'<rect x="{LEFT - 5}" y="{y}" width="{WIDTH - LEFT}" height="{ROW - 6}"/>')
        parts.append(f'<text x="{LEFT + 5}" y="{y + 16}">{escape(question)}</text>')
        x = LEFT + 5.0
        for name in names.split():
            parts.append(_link(name, x, y + 34, root))
            x += 7.9 * (len(name.removeprefix("analysis.")) + 2)
    return (
        '<svg class="chart" role="img" aria-label="Which function answers which question" '
        f'viewBox="0 0 {WIDTH} {height}" xmlns="http://www.w3.org/2000/svg"><style>{STYLE}</style>{"".join(parts)}</svg>'
    )


class FunctionChart(SphinxDirective):
    """``.. function-chart::``."""

    def run(self) -> list[nodes.Node]:
        """Return the chart."""
        return [nodes.raw("", chart("../" * self.env.docname.count("/")), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("function-chart", FunctionChart)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
