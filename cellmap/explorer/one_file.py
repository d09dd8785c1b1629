"""Pages with their style and modules inside, for hosts that have no server for them, and for files."""

from __future__ import annotations

import base64
import re
from pathlib import Path

PAGE = Path(__file__).parent / "page"

_IMPORT = re.compile(r'(from|import) "\./(\w+\.js)"')
_STYLE = re.compile(r'<link rel="icon" href="icon.svg">\n<link rel="stylesheet" href="style.css">')
_MODULE = re.compile(r'<script type="module" src="(\w+\.js)"></script>')


def page_of_one_file(page: str = "index.html", head: str = "") -> str:
    """Return a page with its style and modules inside.

    Its modules know each other by names that an import map leads to data.  ``head``: what stands before them.
    """
    html = (PAGE / page).read_text(encoding="utf-8")
    (first,) = _MODULE.findall(html)
    modules: dict[str, str] = {}
    pending = [first]
    while pending:
        name = pending.pop()
        if name not in modules:
            modules[name] = (PAGE / name).read_text(encoding="utf-8")
            pending += [found[1] for found in _IMPORT.findall(modules[name])]
    data = {name: base64.b64encode(_IMPORT.sub(r'\1 "cellmap/\2"', text).encode()) for name, text in modules.items()}
    listed = ", ".join(
        f'"cellmap/{name}": "data:text/javascript;base64,{code.decode()}"' for name, code in sorted(data.items())
    )
    style = (PAGE / "style.css").read_text(encoding="utf-8")
    inside = f'<style>{style}</style>\n{head}<script type="importmap">{{"imports": {{{listed}}}}}</script>'
    html = _STYLE.sub(lambda _: inside, html)
    return _MODULE.sub(f'<script type="module">import "cellmap/{first}";</script>', html)
