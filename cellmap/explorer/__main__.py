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
    parser.add_argument("--views", metavar="FILE", help="file in TOML with prepared views, for the keys 1 to 9")
    parser.add_argument(
        "--share",
        metavar="N",
        type=int,
        nargs="?",
        const=200,
        default=0,
        help="let others on the network watch, at most N at a time (%(const)s)",
    )
    parser.add_argument("--host", help="address of this machine in the network where others watch")
    options = parser.parse_args(arguments)
    try:
        typed = [] if options.equations is None else [typed_file(options.equations)]
        explorer = serve(
            [*typed, *load_gallery(options.gallery)],
            options.port,
            not options.no_browser,
            options.views,
            options.share,
            options.host,
        )
    except (OSError, ValueError) as error:
        parser.exit(1, f"{parser.prog}: {str(error).rpartition('] ')[2]}\n")
    with explorer:
        print(explorer, flush=True)
        explorer.wait()


if __name__ == "__main__":
    main()
