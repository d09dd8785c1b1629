"""Films in files: animated GIF, folders of PNG, TIFF stacks and, with a plugin, MP4.  They need the package imageio."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cellmap.utils import StoreError, as_path, as_target, claim_memory, finite_number, written_whole

from .film import Film, film_at_rate

_STACKS = (".gif", ".tif", ".tiff")
_VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm")
_IMAGES = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg")
_LUMA = np.array([0.299, 0.587, 0.114])


def read_film(path: str | os.PathLike[str], frame_rate: float | None = None) -> Film:
    """Read a film from a file, or from a folder of images in the order of their names.

    Numbers in names count by their value, so that frame_2 comes before frame_10.  Colours become grey by their
    luminance (ITU-R BT.601).

    Parameters
    ----------
    path : path-like
        A GIF, a TIFF stack, a video, or a folder of images.
    frame_rate : float, optional
        Frames a second, where the file does not say, or says wrongly: a GIF counts in hundredths of a second, and
        cameras of high speed write files that play slowly.  A frame that a GIF shows for several times as long as the
        shortest stands for as many frames.

    Returns
    -------
    Film
        The film, its first frame at 0 s.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    StoreError
        For a truncated or foreign file, and images of different sizes.
    ValueError
        For another suffix, and where neither the file nor `frame_rate` gives the times.
    ModuleNotFoundError
        Without imageio, or the plugin for videos.
    MemoryError
        Where the frames need more memory than is free.
    """
    place = as_path("path", path)
    if not place.exists():
        raise FileNotFoundError(f"path={str(place)!r}: there is no such file")
    rate = None if frame_rate is None else finite_number("frame_rate", frame_rate, above=0.0)
    imageio = _imageio()
    try:
        frames, durations = _images(imageio, place) if place.is_dir() else _file(imageio, place)
    except (ModuleNotFoundError, MemoryError, StoreError, ValueError):
        raise
    except Exception as error:
        raise StoreError(
            f"{str(place)!r} cannot be read as a film, it is truncated or of another kind: {error}"
        ) from error
    if rate is not None and durations is not None and min(durations) > 0.0:
        shown = np.rint(np.array(durations) / min(durations))
        return Film(frames, np.concatenate([[0.0], np.cumsum(shown[:-1])]) / rate)
    if rate is not None:
        return film_at_rate(frames, rate)
    if durations is None or not all(d > 0.0 for d in durations):
        raise ValueError(f"frame_rate=None: {place.name!r} does not say when its frames were taken; give frame_rate=")
    return Film(frames, np.concatenate([[0.0], np.cumsum(durations[:-1])]))


def write_film(film: Film, path: str | os.PathLike[str], frame_rate: float | None = None) -> None:
    """Write a film to a file, or to a new folder of PNG images; whole, or not at all.

    Times are not kept but for the frame rate: a GIF rounds it to hundredths of a second for each frame, and joins equal
    frames; a video rounds it to a whole number, loses an odd last row or column, and alters grey values, by tens at
    the edges of what moves; TIFF and folders have none.  Dropped frames are written as they are, so that the others
    keep their times.

    Parameters
    ----------
    film : Film
        The film, of uint8 (or uint16 for PNG and TIFF); its frames evenly spaced.
    path : path-like
        File with the suffix .gif, .tif, .tiff or .mp4, or a folder that does not exist yet.
    frame_rate : float, optional
        Frames a second at which it plays; by default that of the film, at most 50 for a GIF.

    Raises
    ------
    FileNotFoundError, FileExistsError
        For a place in no folder, and a folder that is there already.
    ValueError
        For another suffix or other grey values, and for uneven times.
    ModuleNotFoundError
        Without imageio, or the plugin for videos.
    """
    place = as_path("path", path)
    steps = np.diff(film.times)
    if frame_rate is None and steps.size and np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError("film has uneven times, which a file does not keep; give frame_rate= to write it nevertheless")
    rate = 1.0 / float(steps.mean()) if frame_rate is None and steps.size else frame_rate or 25.0
    rate = finite_number("frame_rate", rate, above=0.0)
    suffix = place.suffix.lower()
    deep = suffix in ("", ".tif", ".tiff")
    if film.frames.dtype not in ((np.uint8, np.uint16) if deep else (np.uint8,)):
        kinds = "uint8 or uint16" if deep else "uint8"
        raise ValueError(f"film has grey values of {film.frames.dtype}: convert them to {kinds}")
    imageio = _imageio()
    if suffix == "":
        _write_folder(imageio, film, place)
        return
    if suffix not in (*_STACKS, *_VIDEOS):
        raise ValueError(f"path={str(place)!r}: choose the suffix .gif, .tif, .tiff or .mp4, or a folder without one")
    if suffix in _VIDEOS:
        _needs_video()
    with written_whole(as_target("path", place)) as part:
        if suffix in _STACKS:
            timing = {"duration": 1000.0 / min(rate, 50.0), "loop": 0} if suffix == ".gif" else {}
            # Pillow reads back what it writes of a TIFF, which imageio allows it in memory alone.
            claim_memory(f"{len(film):,} frames", 2 * film.frames.nbytes, "write shorter films")
            kind = ".gif" if suffix == ".gif" else ".tiff"
            part.write_bytes(imageio.imwrite("<bytes>", list(film.frames), extension=kind, plugin="pillow", **timing))
        else:
            even = film.frames[:, : film.shape[0] // 2 * 2, : film.shape[1] // 2 * 2]
            coding = {"codec": "libx264", "fps": round(rate), "in_pixel_format": "gray"}
            imageio.imwrite(part, even, extension=suffix, plugin="pyav", **coding)


def _imageio() -> Any:
    try:
        import imageio.v3
    except ModuleNotFoundError:
        raise ModuleNotFoundError("films in files need imageio: pip install 'cellmap-dynamics[video]'") from None
    return imageio.v3


def _needs_video() -> None:
    from importlib.util import find_spec

    if find_spec("av") is None:
        raise ModuleNotFoundError(
            "videos need the package av: pip install 'cellmap-dynamics[video]'; or convert the film to a TIFF stack"
        )


def _file(imageio: Any, path: Path) -> tuple[NDArray[Any], list[float] | None]:
    """Return the frames of a file, and for how long each is shown (s)."""
    suffix = path.suffix.lower()
    if suffix not in (*_STACKS, *_VIDEOS):
        raise ValueError(f"path={str(path)!r}: choose a .gif, .tif, .tiff or .mp4, or a folder of images")
    if suffix in _VIDEOS:
        _needs_video()
        rate = float(imageio.immeta(path, plugin="pyav").get("fps", 0.0))
        frames = _stack(imageio.imiter(path, plugin="pyav"), path)
        return frames, [1.0 / rate] * len(frames) if rate > 0.0 else None
    with imageio.imopen(path, "r", plugin="pillow") as source:
        count, shown = int(source.properties(index=...).n_images or 1), []

        def image(k: int) -> NDArray[Any]:
            shown.append(float(source.metadata(index=k).get("duration", 0.0)) / 1000.0)
            return source.read(index=k)

        return _stack(map(image, range(count)), path, count), shown if suffix == ".gif" else None


def _images(imageio: Any, folder: Path) -> tuple[NDArray[Any], None]:
    found = [p for p in folder.iterdir() if p.suffix.lower() in _IMAGES and not p.name.startswith(".")]
    if not found:
        raise StoreError(f"{str(folder)!r} holds no images: give a folder of {', '.join(_IMAGES)}")

    def image(name: Path) -> NDArray[Any]:
        try:
            return imageio.imread(name)
        except Exception as error:
            raise StoreError(f"{str(name)!r} is truncated or no image: {error}") from error

    return _stack(map(image, sorted(found, key=_by_number)), folder, len(found)), None


def _by_number(path: Path) -> tuple[list[tuple[str, int]], str]:
    """Return what paths are sorted by: their names, with the numbers in them by value."""
    parts = re.split(r"([0-9]+)", path.name)
    return [(text, int(digits)) for text, digits in zip(parts[::2], [*parts[1::2], "0"], strict=True)], path.name


def _grey(image: NDArray[Any]) -> NDArray[Any]:
    """Return an image in grey, with numbers of the same type."""
    values = np.asarray(image)
    if values.ndim == 3 and values.shape[-1] in (3, 4):
        mixed = values[..., :3] @ _LUMA
        values = np.rint(mixed).astype(values.dtype) if values.dtype.kind == "u" else mixed
    elif values.ndim == 3 and values.shape[-1] in (1, 2):
        values = values[..., 0]
    if values.dtype == bool:
        values = values.astype(np.uint8) * np.uint8(255)
    if values.ndim != 2:
        raise StoreError(f"a frame has the shape {values.shape}, which is no image in grey or colours")
    return values


def _stack(images: Iterable[NDArray[Any]], path: Path, count: int = 0) -> NDArray[Any]:
    """Return images in grey as one array; how many there are is known of files that could fill the memory."""
    grey: list[NDArray[Any]] = []
    for image in images:
        grey.append(_grey(image))
        if len(grey) == 1:
            claim_memory(f"{count:,} frames", count * grey[0].nbytes, "take fewer or smaller frames")
    if not grey:
        raise StoreError(f"{str(path)!r} holds no frame")
    kinds = {(frame.shape, frame.dtype.name) for frame in grey}
    if len(kinds) > 1:
        raise StoreError(f"{str(path)!r} holds frames of different sizes or kinds: {sorted(kinds, key=str)}")
    return np.stack(grey)


def _write_folder(imageio: Any, film: Film, folder: Path) -> None:
    if os.path.lexists(folder):
        raise FileExistsError(f"path={str(folder)!r} is there already: remove it, or give another name")
    if not folder.parent.is_dir():
        raise FileNotFoundError(f"path={str(folder)!r}: there is no folder {str(folder.parent)!r}; make it first")
    part = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=".part"))
    try:
        digits = max(6, len(str(len(film))))
        for k, frame in enumerate(film.frames):
            imageio.imwrite(part / f"frame_{k:0{digits}d}.png", frame)
        part.chmod(0o755)
        part.replace(folder)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
