"""References by the last part of a name, as docstrings write them, where one documented object alone has that name."""

from __future__ import annotations

from typing import Any

from docutils.nodes import Element
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: Element) -> Element | None:
    """Return a reference to the object whose name has the same last part; those of `cellmap` itself come first."""
    if node.get("refdomain") != "py":
        return None
    last = node["reftarget"].split(".")
    objects: dict[str, Any] = env.domains["py"].objects  # type: ignore[attr-defined]
    tails = [last[-1:], last[-2:]]
    found = [name for name in objects if name.split(".")[-1:] in tails or name.split(".")[-2:] in tails]
    if node["reftype"] in ("attr", "meth") and len(last) > 1:
        found = [name for name in found if name.split(".")[-2:] == last[-2:]]
    found.sort(key=lambda name: (name.count("."), not name.startswith("cellmap"), name))
    if not found:
        return None
    entry = objects[found[0]]
    return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, contnode, found[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the resolver."""
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
