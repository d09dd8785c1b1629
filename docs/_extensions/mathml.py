"""Formulas as MathML, which browsers typeset by themselves: pages need no script for them, and no network."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, cast

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util import logging

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

LOG = logging.getLogger(__name__)
FUNCTION = r"<m[io]>(?:arcsin|arctan|cos|cosh|det|exp|lim|ln|log|max|min|sin|sinh|tan|tanh|Im|Re)</m[io]>"
BEFORE = re.compile(rf"(</m(?:i|n|row|sub|sup|over|frac)>)({FUNCTION})")
BEHIND = re.compile(rf"({FUNCTION})(<m(?:i|n|over|sub|sup|frac)>)")
BAR = re.compile(r"<mo[^>]*>(?:\||&#x0007C;)</mo>")
THIN = '<mspace width="0.1667em"/>'
UNKNOWN = re.compile(r"\\[A-Za-z]+|<merror|<mtext></mtext>")


def mathml(formula: str, display: str = "inline") -> str:
    """Return a formula in TeX's notation as MathML.

    Raises
    ------
    ValueError
        Where the converter does not know a command.

    Examples
    --------
    >>> "<msup><mi>x</mi><mn>2</mn></msup>" in mathml("x^2")
    True
    """
    found = convert(formula, display=display)
    shown = re.sub(r"<annotation.*?</annotation>", "", found)
    if unknown := UNKNOWN.search(shown):
        raise ValueError(f"{formula!r}: {unknown[0]} is not known")
    # As TeX sets them: accents close to letters, bars close to what is between them, thin spaces beside functions.
    found = found.replace("<mover>", '<mover accent="true">')
    found = BAR.sub('<mo stretchy="false" lspace="0" rspace="0">|</mo>', found)
    return cast(str, BEHIND.sub(rf"\1{THIN}\2", BEFORE.sub(rf"\1{THIN}\2", found)))


def _put(translator: HTML5Translator, node: Element, display: str) -> None:
    formula = node.astext()
    try:
        text = mathml(formula, display)
    except Exception as error:
        LOG.warning("formula: %s", error, location=node)
        text = translator.encode(formula)
    if display == "block":
        text = f'<div class="formula">{text}</div>'
    translator.body.append(text)
    raise nodes.SkipNode


def inline(translator: HTML5Translator, node: Element) -> None:
    """Write a formula in a line of text."""
    _put(translator, node, "inline")


def block(translator: HTML5Translator, node: Element) -> None:
    """Write a formula on a line of its own."""
    _put(translator, node, "block")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer under the name that ``html_math_renderer`` gives."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
