"""Rigorous enclosures of the images of boxes, in mean-value form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.codegen.enclosures import BoxLayout
from .._compiled.codegen.expression import UntraceableError
from .._lib.arrays import Bools, Floats
from .._lib.checks import finite_number, known_parameter, pair_of, real_array, shown
from .discrete import Discrete
from .followed_boxes import FollowedBoxes, carried, started
from .point_map import PointMap
from .stroboscopic import Stroboscopic

_LARGEST = 8  # states of a flow: beyond, code takes minutes to compile

Intervals = Mapping[str, Sequence[float]]
"""Intervals of parameters by name: the lower and the upper end."""


@dataclass(frozen=True, eq=False)
class MeanValueForms:
    """Enclosures of a map F over n boxes in d dimensions, by a mean-value form for each.

    For every point x of a box abs(x - centre) <= half_width, F(x) lies in
    ``images +- image_radii + (derivatives +- derivative_radii) (x - centre)``.

    Parameters
    ----------
    images, image_radii : ndarray, shape (n, d)
        Enclosure of the images of the centres; angles are not wrapped.
    derivatives, derivative_radii : ndarray, shape (n, d, d)
        Enclosure of the derivatives DF(x) at all points x of the box.
    spreads : ndarray, shape (n, d)
        Bounds of ``abs(F(x) - images - derivatives (x - centre))`` for all points x of the box, which are what the
        radii say, or less.
    proved : ndarray of bool, shape (n,)
        False where there is no enclosure; all numbers of the row are NaN then.
    """

    images: Floats
    image_radii: Floats
    derivatives: Floats
    derivative_radii: Floats
    spreads: Floats
    proved: Bools

    @classmethod
    def of(cls, rows: BoxLayout, found: Floats) -> MeanValueForms:
        """Return the forms in the rows of a kernel (n, rows), of which some are not known."""
        n, d = len(found), rows.d
        proved = np.asarray(np.isfinite(found[:, : rows.remainder]).all(axis=1))
        found = np.where(proved[:, None], found, np.nan)
        images, radii, spreads = (found[:, r] for r in (rows.images, rows.image_radii, rows.spreads))
        derivatives, loose = (found[:, r].reshape(n, d, d) for r in (rows.derivatives, rows.derivative_radii))
        return cls(images, radii, derivatives, loose, spreads, proved)

    def __repr__(self) -> str:
        return f"MeanValueForms({np.count_nonzero(self.proved)} of {len(self.proved)} boxes enclosed)"

    def __len__(self) -> int:
        return len(self.proved)


def enclosed_images(
    point_map: PointMap, centres: ArrayLike, half_widths: ArrayLike, *, parameters: Intervals | None = None
) -> MeanValueForms:
    """Return rigorous enclosures of the images of boxes after one step of a map.

    What is proved is a theorem about real numbers: about the map whose formulas are those that the function writes,
    with its parameters and literals as exact doubles.  Numbers that the function computes from literals alone, such as
    ``2 * pi`` or ``sqrt(0.5)``, are the doubles that Python makes of them.  A period of a flow lasts exactly as long as
    the double ``system.length`` says, from the time ``phase * system.length`` as a double on.  So the theorem is about
    orbits of ``cos(omega * t)`` at times a double apart that is near a period of this cosine, and not equal to it.

    It rests on IEEE 754 arithmetic in double precision, rounded to nearest and with gradual underflow, in the processor
    and in the code that LLVM makes of instructions without flags, and on this program.

    Parameters
    ----------
    point_map : PointMap
        A discrete or a stroboscopic map whose formulas are known and analytic.
    centres : array_like, shape (n, d)
        Centres of the boxes.  Angles need not be wrapped.
    half_widths : array_like, shape (d,) or (n, d)
        Half of their edges, at least 0.
    parameters : mapping of str to (float, float), optional
        Intervals of parameters: the enclosure then holds for every value of these.  By default each is the number that
        the map has.  A period that is a function of parameters may be any number that this function has over the
        intervals, in real numbers and in doubles.

    Returns
    -------
    MeanValueForms
        Enclosures.  Boxes for which there is none have ``proved`` False: where a number is NaN or overflows, a
        denominator or the argument of a root or logarithm may be zero, or a box is too large.

    Raises
    ------
    TypeError, ValueError
        For maps without enclosures, with the reason, and arguments of wrong shapes.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.a * x[0] * (1.0 - x[0]),), {"a": 3.5}, ("x",))
    >>> forms = enclosed_images(logistic, [[0.3], [0.5]], [0.01])
    >>> forms.images.ravel(), forms.derivatives.ravel()
    (array([0.735, 0.875]), array([1.4, 0. ]))
    >>> bool((forms.derivative_radii >= 0.07).all()), bool((forms.image_radii < 1e-15).all())
    (True, True)
    """
    check_arithmetic()
    spec = _enclosable(point_map)
    c, w = _boxes(centres, half_widths, point_map.dimension)
    p = _parameters(point_map, parameters)
    try:
        if isinstance(spec, Discrete):
            kernel = spec.enclosure()
            return MeanValueForms.of(kernel.rows, carried(kernel, started(kernel.rows, c, w), p))
        boxes = FollowedBoxes(spec, c, w, p, exact=not parameters)
        boxes.advance()
        return MeanValueForms.of(boxes.kernel.rows, boxes.rows)
    except UntraceableError as error:
        raise ValueError(
            f"point_map={point_map!r}: {error}; write the function with analytic functions and without branches"
        ) from error


def followed_boxes(
    point_map: PointMap, centres: Floats, half_widths: Floats, parameters: Intervals | None = None
) -> FollowedBoxes | None:
    """Return boxes (n, d) whose images are to be enclosed for many periods of a flow; None for a discrete map."""
    check_arithmetic()
    spec, p = _enclosable(point_map), _parameters(point_map, parameters)
    if isinstance(spec, Discrete):
        return None
    return FollowedBoxes(spec, centres, half_widths, p, exact=not parameters, far=True)


def check_arithmetic() -> None:
    """Hold the processor to rounding to nearest and to gradual underflow.

    Raises
    ------
    ArithmeticError
        If another program in this process has changed either.
    """
    one, least = np.ones(2), np.full(2, 5e-324)
    rounded = (one + np.array([2.0**-53, 0.75 * 2.0**-52])).tolist() == [1.0, 1.0 + 2.0**-52]
    if not rounded or (-one - 0.75 * 2.0**-52).tolist() != 2 * [-1.0 - 2.0**-52] or (0.5 * (3.0 * least) == 0.0).any():
        raise ArithmeticError(
            "the processor does not round to nearest, or flushes small numbers to zero: another library has changed "
            "its mode, and no enclosure would hold; run the proof in a process without that library"
        )


def _enclosable(point_map: PointMap) -> Discrete | Stroboscopic:
    """Return the specification of a map that may have an enclosure."""
    spec = point_map.spec
    if point_map.table is not None:
        raise ValueError(f"point_map={point_map!r}: an interpolated map has no enclosure; give point_map.exact")
    if point_map.unknown_formulas:
        raise ValueError(
            f"point_map={point_map!r}: only formulas are enclosed; write the function with plain arithmetic and "
            "functions of math"
        )
    if point_map.ends:
        raise ValueError(
            f"point_map={point_map!r}: orbits that end ({', '.join(point_map.ends)}) are not enclosed; give the map of "
            "the system without ends to prove what its attractors attract, or certify basins with ends by samples"
        )
    if not isinstance(spec, Discrete | Stroboscopic):
        raise TypeError(
            f"point_map={point_map!r}: this kind of map has no enclosure; give one of discrete_map or stroboscopic_map"
        )
    if isinstance(spec, Stroboscopic) and point_map.dimension > _LARGEST:
        raise ValueError(f"point_map={point_map!r}: flows are enclosed for up to {_LARGEST} state variables")
    if isinstance(spec, Stroboscopic) and spec.system.functions[1:] != (None, None):
        raise ValueError(f"point_map={point_map!r}: impacts and switches are not enclosed; give a smooth system")
    return spec


def _boxes(centres: ArrayLike, half_widths: ArrayLike, d: int) -> tuple[Floats, Floats]:
    """Return centres and half-widths (n, d) as floats."""
    c, w = real_array("centres", centres), real_array("half_widths", half_widths)
    if c.ndim != 2 or c.shape[1] != d:
        raise ValueError(f"centres has the shape {c.shape}: give rows of {d} numbers, one for each coordinate")
    if w.shape not in {(d,), c.shape}:
        raise ValueError(f"half_widths has the shape {w.shape}: give {d} numbers, or {len(c)} rows of them")
    return c, np.broadcast_to(w, c.shape)


def _parameters(point_map: PointMap, intervals: Intervals | None) -> Floats:
    """Return midpoints and radii of the parameters, one after the other."""
    found = {name: (float(value), 0.0) for name, value in point_map.params.items()}
    for name, ends in (intervals or {}).items():
        what = f"parameters[{known_parameter('parameters', name, point_map.params)!r}]"
        low, high = (finite_number(what, end) for end in pair_of(what, ends))
        if low > high:
            raise ValueError(f"{what}={shown(ends)}: give the lower end first")
        middle = 0.5 * low + 0.5 * high
        found[name] = middle, 0.0 if low == high else float(np.nextafter(max(high - middle, middle - low), np.inf))
    return np.array([number for pair in found.values() for number in pair])
