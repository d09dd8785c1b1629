"""Command line of the explorer: ``python -m cellmap.explorer``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from .equations import typed_file
from .explored import load_gallery
from .serving import serve


def main(arguments: Sequence[str] | None = None) -> None:
    """Serve the explorer until it is interrupted."""
    parser = argparse.ArgumentParser(prog="python -m cellmap.explorer", description=__doc__)
    parser.add_argument("--port", type=int, default=0, help="port on this machine (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no page")
    parser.add_argument(
        "--gallery", default="systems.gallery", help="module with a list GALLERY of systems (default: %(default)s)"
    )
    parser.add_argument("--equations", metavar="FILE", help="text file with equations, which are shown first")
    options = parser.parse_args(arguments)
    try:
        typed = [] if options.equations is None else [typed_file(options.equations)]
        explorer = serve([*typed, *load_gallery(options.gallery)], options.port, open_page=not options.no_browser)
    except (OSError, ValueError) as error:
        parser.exit(1, f"{parser.prog}: {str(error).rpartition('] ')[2]}\n")
    with explorer:
        print(explorer.address, flush=True)
        explorer.wait()


if __name__ == "__main__":
    main()
