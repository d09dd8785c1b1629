"""Floquet multipliers of equilibria, by a vectorised parameter sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._compiled.codegen.kernel import why_untraced
from .._compiled.codegen.linear import LinearKernel, linear_kernel, values
from .._lib.arrays import Complexes, Floats, Ints
from .._lib.checks import check_mapping, claim_memory, finite_number, real_array, shown
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import state_points
from ..maps.formulas import harmonics_of
from ..maps.integration import Flow, steps_of_harmonics
from ..maps.orbit_batch import Orbits, Status
from ..maps.system import ForcedSystem
from ..orbits.multipliers import multipliers_of, unstable_count
from .crossings import Matrices

POINTS = 4096
"""Parameter points in a chunk of work.  Fixed, so that results do not depend on the number of threads."""

_MAX_STEPS = 1_000_000
_TIMES = 16  # looks at the right-hand side, to see that it vanishes
_SAMPLES = 1024  # looks at the forcing
_RESIDUAL = 1e-9  # displacement from an equilibrium, relative to its size, that is taken for rounding


@dataclass(frozen=True, eq=False)
class FloquetResult:
    """Floquet multipliers of an equilibrium at many parameter values.

    Parameters
    ----------
    multipliers : ndarray of complex, shape (..., dimension)
        Eigenvalues of the monodromy matrices, by decreasing modulus, of a complex pair the one above the real axis
        first; NaN where `status` is DIVERGED.
    monodromy : ndarray, shape (..., dimension, dimension)
        Monodromy matrices: derivatives of the state after one period by the initial state, at the equilibrium.
    determinant : ndarray, shape (...)
        Determinant of the monodromy matrix from the trace of the linearised system (Liouville's formula): the product
        of the multipliers, accurate even where it is tiny.
    status : ndarray of uint8, shape (...)
        A :class:`Status` of each parameter point.
    """

    multipliers: Complexes
    monodromy: Floats
    determinant: Floats
    status: NDArray[np.uint8]

    def __repr__(self) -> str:
        stable = np.count_nonzero(self.unstable == 0)
        return f"FloquetResult({self.status.size} parameter points, {stable} without unstable multipliers)"

    @property
    def largest(self) -> Floats:
        """Largest modulus of the multipliers, shape (...)."""
        return np.abs(self.multipliers[..., 0])

    @property
    def unstable(self) -> Ints:
        """Number of multipliers outside the unit circle by more than 1e-8, shape (...); -1 where they are not known."""
        return unstable_count(self.multipliers)

    @property
    def error(self) -> Floats:
        """Difference of the determinant of the matrix from Liouville's, relative to the size of the matrix.

        It checks the integration and is of the order of its tolerance.  Shape (...).
        """
        size = np.linalg.norm(self.monodromy, axis=(-2, -1)) ** self.monodromy.shape[-1]
        return np.abs(np.linalg.det(self.monodromy) - self.determinant) / size


@checked
def floquet_multipliers(
    system: ForcedSystem, equilibrium: ArrayLike, params: Mapping[str, ArrayLike] | None = None, rtol: float = 1e-10
) -> FloquetResult:
    """Compute the Floquet multipliers of an equilibrium that is the same state at all parameter values.

    The linearised system is integrated over one period, one SIMD lane for each direction and parameter point, to a
    tolerance.  Its coefficients are exact derivatives of the right-hand side.

    Parameters
    ----------
    system : ForcedSystem
        System without switching functions, whose right-hand side can be traced and differentiated.
    equilibrium : array_like, shape (dimension,)
        State at which the right-hand side vanishes at all times, in units of the coordinates.
    params : mapping of str to array_like, optional
        Values of some parameters, arrays that broadcast against each other to shape (...).  The others keep the values
        that the system has.  The period follows if it is a function of the parameters.
    rtol : float, optional
        Tolerance of the monodromy matrices, relative to each entry where it is above 1, from 1e-14 to 1e-2.

    Returns
    -------
    FloquetResult
        Multipliers (..., dimension), matrices (..., dimension, dimension), statuses (...).

    Raises
    ------
    TypeError
        For a discontinuous (Filippov) right-hand side, or one whose derivatives are not known.
    ValueError
        For a state that is not an equilibrium at some parameter point, an unknown parameter, or values that are not
        finite.
    MemoryError
        If the result needs more memory than is free.

    References
    ----------
    Floquet, Annales scientifiques de l'Ecole Normale Superieure 12 (1883) 47; Yakubovich, Starzhinskii, *Linear
    Differential Equations with Periodic Coefficients* (1975).

    Examples
    --------
    >>> from math import cos, pi, sin
    >>> def rhs(t, x, p):
    ...     theta, v = x
    ...     return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(theta)
    >>> pendulum = ForcedSystem(rhs, {"alpha": 0.01, "beta": 0.2, "gamma": 0.05}, 2 * pi, ("theta", "v"))
    >>> inverted = floquet_multipliers(pendulum, [pi, 0.0], {"beta": [0.1, 0.2]})
    >>> inverted
    FloquetResult(2 parameter points, 1 without unstable multipliers)
    >>> inverted.multipliers.shape
    (2, 2)
    """
    given = {} if params is None else params
    check_mapping("params", given, "of names to arrays, such as {'amplitude': [0.1, 0.2]}")
    arrays = {name: swept_values(f"params[{name!r}]", array) for name, array in given.items()}
    try:
        shape = np.broadcast_shapes(*(a.shape for a in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise ValueError(
            f"parameters have the shapes {shapes}: give arrays that broadcast against each other"
        ) from None
    count = int(np.prod(shape))
    linear = linearise(system, equilibrium, tuple(arrays), rtol)
    d = linear.dimension
    claim_memory(f"Floquet multipliers at {count} points", 8 * count * (d * d + 3 * d + 4), "give fewer values")
    columns = [np.broadcast_to(a, shape).ravel() for a in arrays.values()]
    points = np.stack(columns, axis=-1) if columns else np.empty((count, 0))
    linear.check(points)
    matrices, logarithms, status = linear.monodromy(points, progress="Floquet multipliers")
    determinant = np.exp(logarithms)
    return FloquetResult(
        multipliers_of(matrices, determinant).reshape(*shape, d),
        matrices.reshape(*shape, d, d),
        determinant.reshape(shape),
        status.reshape(shape),
    )


@dataclass(frozen=True, eq=False)
class Linearised:
    """A system linearised about an equilibrium, as a function of some of its parameters."""

    system: ForcedSystem
    equilibrium: Floats
    swept: tuple[str, ...]
    compiled: LinearKernel
    rtol: float

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return len(self.equilibrium)

    @property
    def parameters(self) -> Floats:
        """Parameters of the kernel: those of the system, and a period that is a number."""
        period = 1.0 if callable(self.system.period) else self.system.period
        return np.array([*self.system.params.values(), period])

    def monodromy(self, points: Floats, progress: str | None = None) -> tuple[Floats, Floats, NDArray[np.uint8]]:
        """Return monodromy matrices (n, d, d), logarithms of their determinants (n) and statuses (n).

        `points` (n, m) are values of the swept parameters.
        """
        d, m = self.dimension, len(self.swept)
        matrices, logarithms = np.empty((len(points), d, d)), np.empty(len(points))
        status = np.empty(len(points), np.uint8)
        motion = Flow(
            kernel=self.compiled.kernel,
            parameters=self.parameters,
            begin=0.0,
            length=1.0,
            rtol=self.rtol,
            atol=np.full(d + 1 + m, self.rtol),
            max_steps=_MAX_STEPS,
            largest=np.full(d + 1 + m, np.inf),
            fewest_steps=self._fewest_steps(points),
        )

        def work(part: slice) -> None:
            initial_conditions = np.zeros((part.stop - part.start, d, d + 1 + m))
            initial_conditions[:, :, :d] = np.eye(d)
            initial_conditions[:, :, d + 1 :] = points[part, None, :]
            orbits = Orbits.starting(initial_conditions.reshape(-1, d + 1 + m))
            motion(orbits)
            ends = orbits.points.reshape(-1, d, d + 1 + m)
            matrices[part] = ends[:, :, :d].transpose(0, 2, 1)
            logarithms[part] = ends[:, 0, d]
            status[part] = orbits.status.reshape(-1, d).max(axis=1)

        run_over(slices(len(points), POINTS), work, progress)
        lost = status >= Status.ESCAPED
        matrices[lost], logarithms[lost] = np.nan, np.nan
        return matrices, logarithms, status

    def matrices(self, points: Floats, progress: str | None = None) -> Matrices:
        """Return the monodromy matrices at parameter points (n, m)."""
        matrices, logarithms, status = self.monodromy(points, progress)
        return Matrices(matrices, np.exp(logarithms), np.expm1(logarithms), status)

    def check(self, points: Floats) -> None:
        """Raise ValueError where the state is no equilibrium, or the period is not that of the right-hand side."""
        extremes = {int(find(column)) for column in points.T for find in (np.argmin, np.argmax)} if len(points) else ()
        for k in sorted(extremes):
            # A system is checked when it is made, its period among all.
            self.system.with_params(**dict(zip(self.swept, points[k].tolist(), strict=True)))
        if not any(e.operation != "constant" or e.value for e in self.compiled.rates):
            return
        times, d = np.arange(_TIMES)[:, None] / _TIMES, self.dimension
        for part in slices(len(points), POINTS):
            swept, grid = list(points[part].T), (_TIMES, part.stop - part.start)
            rates = values(self.compiled.rates, times, [*np.zeros(d + 1), *swept], self.parameters)
            found = np.abs([np.broadcast_to(r, grid) for r in rates])
            fastest = np.zeros(grid[1])
            for unit in np.eye(d):
                slopes = values(self.compiled.motion.outputs[:d], times, [*unit, 0.0, *swept], self.parameters)
                fastest = np.fmax(fastest, np.abs([np.broadcast_to(s, grid) for s in slopes]).max(axis=(0, 1)))
            wrong = (found > _RESIDUAL * max(1.0, float(np.abs(self.equilibrium).max())) * fastest).any(axis=(0, 1))
            if wrong.any():
                k = int(np.argmax(wrong))
                j, i = np.unravel_index(int(np.argmax(found[:, :, k])), found.shape[:2])
                at = "".join(f", {name}={value:g}" for name, value in zip(self.swept, points[part][k], strict=True))
                raise ValueError(
                    f"equilibrium={self.equilibrium.tolist()}: {self.system.axes[j].name} is not constant there but "
                    f"changes by {found[j, i, k]:g} a period (at {times[i, 0]:g} of a period{at}); give a state at "
                    "which the right-hand side vanishes at all times and for all these parameters"
                )

    def _fewest_steps(self, points: Floats) -> int:
        """Return the steps without which a part of the forcing might be passed over, at some of the points."""
        if not len(points):
            return 1
        some = points[np.linspace(0, len(points) - 1, 5).astype(int)]
        times = np.arange(_SAMPLES)[:, None] / _SAMPLES
        directions = [1.0 + 0.1 * j for j in range(self.dimension)]
        states = [*directions, 0.0, *some.T]
        outputs = values(self.compiled.motion.outputs[: self.dimension], times, states, self.parameters)
        samples = np.stack([np.broadcast_to(o, (_SAMPLES, len(some))) for o in outputs])
        samples = samples[:, :, np.isfinite(samples).all(axis=(0, 1))]
        return steps_of_harmonics(harmonics_of(np.moveaxis(samples, 1, 0)))


def linearise(system: ForcedSystem, equilibrium: ArrayLike, swept: Sequence[str], rtol: float) -> Linearised:
    """Compile the linearised period as a function of some parameters; raise as :func:`floquet_multipliers` does."""
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem")
    if system.functions[1:] != (None, None):
        raise TypeError(
            f"system={system.name}: its right-hand side is discontinuous and has no linearisation there; "
            "give a system without switching functions (no dry friction)"
        )
    tolerance = finite_number("rtol", rtol, at_least=1e-14, at_most=1e-2)
    state = state_points("equilibrium", equilibrium, system.axes)
    if state.ndim != 1:
        raise ValueError(f"equilibrium has shape {state.shape}: give one state")
    for name in swept:
        if not isinstance(name, str) or name not in system.params:
            raise ValueError(f"params has {shown(name)}: this system has {sorted(system.params)}")
    period = system.period if callable(system.period) else None
    compiled = None
    reason = why_untraced(system.rhs, system.dimension, system.params)
    if not reason:
        functions = (system.rhs, period)
        compiled = linear_kernel(functions, tuple(state.tolist()), tuple(system.params), tuple(swept), tolerance)
    if compiled is None:
        raise TypeError(
            f"system={system.name}: derivatives of its right-hand side are not known; write it with plain arithmetic "
            f"and functions of math, without branches{reason and f' ({reason})'}"
        )
    return Linearised(system, state, tuple(swept), compiled, tolerance)


def swept_values(name: str, given: ArrayLike) -> Floats:
    """Return values of a parameter as floats, all finite."""
    array = real_array(name, given)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has the value {array[~np.isfinite(array)].flat[0]}: give finite numbers")
    return array
