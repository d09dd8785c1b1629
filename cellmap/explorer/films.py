"""Films of basins while a parameter changes, as GIF, MP4, or a page in which it is moved by hand."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .._lib.checks import finite_number, known_parameter, one_of, whole_array, whole_number
from .._lib.stopping import Stopped
from .explored import Explored
from .family import Still, file_of_family, to_and_fro
from .protocol import LOWEST
from .questions import range_of
from .view import View

MOST_STILLS = 240

_MOST_COLOURS = 254  # colours of a GIF, beside white and black for the line below the image
_RATE = 12.5  # stills a second; a GIF counts in hundredths of a second
_SMALLEST = 480  # pixels; smaller images are enlarged in videos, which keep colours at half the resolution
_QUALITY = "16"  # constant rate factor of H.264: lower is better, 0 is without loss


class FilmStopped(Stopped):
    """A film that was ended before it was complete, after `done` of `of` images."""

    def __init__(self, done: int, of: int) -> None:
        super().__init__(f"the film was stopped after {done} of {of} images: ask for it again, and it goes on there")
        self.facts = {"done": done, "of": of}


@dataclass(frozen=True, eq=False)
class Film:
    """A film that the page has asked for: the parameters that change, the format, and colours from the lowest label."""

    parameters: tuple[str, ...]
    form: str
    palette: NDArray[np.uint8]

    @classmethod
    def of(cls, asked: Mapping[str, Any], view: View) -> tuple[Film, tuple[View, ...]]:
        """Return the film that a message asks for, and its views: over two parameters where there is an `across`."""
        chosen = one_of("format", asked.get("format") or "gif", ("gif", "mp4", "html"))
        across = asked.get("across")
        if across is not None and (chosen != "html" or not isinstance(across, Mapping)):
            raise ValueError("across: films go along one parameter, pages along two")
        stills = whole_number("stills", asked.get("stills"), at_least=2, at_most=MOST_STILLS)
        ranges = [range_of(asked)] if across is None else [range_of(asked), range_of(across)]
        number = stills if across is None else max(2, isqrt(stills))
        values = {
            known_parameter("parameter", name, view.params): np.linspace(
                finite_number("lower", lower), finite_number("upper", upper), number
            )
            for name, lower, upper in ranges
        }
        if len(values) < len(ranges):
            raise ValueError("across: choose another parameter than the first one")
        if chosen == "mp4" and find_spec("av") is None:
            raise ValueError("videos need the package av: pip install 'cellmap-dynamics[video]', or take a GIF")
        return cls(tuple(values), chosen, _palette(asked.get("palette"))), to_and_fro(view, values)

    def file(self, explored: Explored, stills: Sequence[Still]) -> tuple[dict[str, str], bytes]:
        """Return the name and media type of the file, and its bytes, from views and their images of labels."""
        if self.form == "html":
            return {"name": "basins.html", "media": "text/html"}, file_of_family(explored, self.parameters, stills)
        images = [self._still(still.view, still.raster) for still in stills]
        if self.form == "gif":
            return {"name": "basins.gif", "media": "image/gif"}, _gif(images)
        return {"name": "basins.mp4", "media": "video/mp4"}, _mp4(images)

    def _still(self, view: View, raster: NDArray[np.int16]) -> Image.Image:
        """Return an image in the colours of the palette, above a line that says the value of the parameter."""
        last = min(len(self.palette), _MOST_COLOURS) - 1
        codes = np.minimum(raster - LOWEST, last).astype(np.uint8)
        height, width = codes.shape
        line = max(16, width // 20)
        still = Image.fromarray(np.concatenate([codes, np.full((line, width), last + 1, np.uint8)]))
        still.putpalette([*self.palette[: last + 1].ravel().tolist(), 255, 255, 255, 0, 0, 0])
        text = f"{self.parameters[0]} = {view.params[self.parameters[0]]:.5g}"
        pen = ImageDraw.Draw(still)
        pen.fontmode = "1"  # a palette has no shades
        pen.text((4, height + line // 2), text, fill=last + 2, font=ImageFont.load_default(0.7 * line), anchor="lm")
        return still


def _palette(given: Any) -> NDArray[np.uint8]:
    """Return colours as an array (n, 3)."""
    colours = whole_array("palette", given)
    if colours.ndim != 2 or colours.shape[1] != 3 or not len(colours) or colours.min() < 0 or colours.max() > 255:
        raise ValueError("palette: give a list of colours, each of it three whole numbers from 0 to 255")
    return colours.astype(np.uint8)


def _gif(images: Sequence[Image.Image]) -> bytes:
    file, milliseconds = io.BytesIO(), round(1000 / _RATE)
    images[0].save(
        file, "GIF", save_all=True, append_images=images[1:], duration=milliseconds, loop=0, optimize=False, disposal=1
    )
    return file.getvalue()


def _mp4(images: Sequence[Image.Image]) -> bytes:
    """Return a video that browsers play: H.264 with even numbers of pixels, and colours at half the resolution."""
    from fractions import Fraction

    import av

    width, height = images[0].size
    enlarged = -(-_SMALLEST // width)
    size = enlarged * width + enlarged * width % 2, enlarged * height + enlarged * height % 2
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(_RATE), options={"crf": _QUALITY})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for image in images:
            pixels = np.asarray(image.convert("RGB").resize(size, Image.Resampling.NEAREST))
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode())
    return file.getvalue()
