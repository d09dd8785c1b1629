"""Storage of attractors in HDF5 files."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import h5py
import numpy as np

from .._lib.sealed import array_of, get_number, get_numbers, get_text, group_of, put_text
from ..maps.coordinates import Coordinate
from ..orbits.attractor import Attractor, Cover, Kind, Neighbourhood
from ..orbits.invariant_circle import InvariantCircle
from ..orbits.invariant_torus import InvariantTorus

_SAMPLED = (Kind.CHAOTIC, Kind.EQUILIBRIA, Kind.CONTINUUM, Kind.QUASIPERIODIC)  # kinds of which the points are a sample


def write_attractors(group: h5py.Group, attractors: Sequence[Attractor]) -> None:
    """Write attractors under their numbers."""
    for k, attractor in enumerate(attractors):
        _write_attractor(group.create_group(str(k)), attractor)


def read_attractors(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> tuple[Attractor, ...]:
    """Read what :func:`write_attractors` wrote."""
    return tuple(_read_attractor(group_of(group, str(k)), coordinates) for k in range(len(group)))


def _write_attractor(group: h5py.Group, attractor: Attractor) -> None:
    put_text(group, "kind", str(attractor.kind))
    put_text(group, "name", attractor.name)
    group.attrs.update(period=attractor.period, turns=attractor.rotations, grazing=attractor.grazing_distance)
    for name in ("points", "multipliers", "exponents", "resolution"):
        if (value := getattr(attractor, name)) is not None:
            group[name] = value
    for part in ("neighbourhood", "cover", "circle", "torus"):
        record = getattr(attractor, part)
        if record is not None:
            for field in dataclasses.fields(record):
                if (value := getattr(record, field.name)) is not None:
                    group[f"{part}/{field.name}"] = value


def _read_attractor(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> Attractor:
    d = len(coordinates)
    kind, period = Kind(get_text(group, "kind")), get_number(group, "period")
    points = array_of(group, "points", np.float64, (None if kind in _SAMPLED else period, d))
    if not len(points) or not np.isfinite(points).all():
        raise ValueError(f"{group.name} has no points")
    neighbourhood, cover = None, None
    if "neighbourhood" in group:
        neighbourhood = Neighbourhood(
            array_of(group, "neighbourhood/centres", np.float64, (period, d)),
            array_of(group, "neighbourhood/metrics", np.float64, (period, d, d)),
            float(array_of(group, "neighbourhood/contraction", np.float64, ())),
        )
        if not all(np.isfinite(part).all() for part in dataclasses.astuple(neighbourhood)):
            raise ValueError(f"{group.name} has no trapping region")
    if "cover" in group:
        boxes = array_of(group, "cover/boxes", np.int64, (None, d))
        cover = Cover(
            array_of(group, "cover/lower", np.float64, (d,)),
            array_of(group, "cover/widths", np.float64, (d,)),
            boxes,
            array_of(group, "cover/certain", np.bool_, (len(boxes),)) if "cover/certain" in group else None,
        )
    circle = _read_circle(group, d) if "circle" in group else None
    grazing = group.attrs.get("grazing", np.inf)
    multipliers = array_of(group, "multipliers", np.complex128, (None,))
    exponents = array_of(group, "exponents", np.float64, (None,))
    if (
        not isinstance(grazing, float)
        or grazing < 0.0
        or len(multipliers) not in (0, d)
        or len(exponents) not in (0, 1, d)
    ):
        raise ValueError(f"{group.name} has {len(multipliers)} multipliers, {len(exponents)} exponents, {grazing=}")
    return Attractor(
        kind=kind,
        period=period,
        points=points,
        rotations=tuple(get_numbers(group, "turns", d)),
        multipliers=multipliers,
        exponents=exponents,
        coordinates=coordinates,
        neighbourhood=neighbourhood,
        cover=cover,
        circle=circle,
        torus=_read_torus(group, d) if "torus" in group else None,
        grazing_distance=float(grazing),
        resolution=array_of(group, "resolution", np.float64, (d,)) if "resolution" in group else None,
    )


def _read_circle(group: h5py.Group, d: int) -> InvariantCircle:
    coefficients = array_of(group, "circle/coefficients", np.complex128, (None, d, None))
    if not len(coefficients) or coefficients.shape[-1] % 2 == 0:
        raise ValueError(f"{group.name} has Fourier coefficients of shape {coefficients.shape}")
    numbers = ("frequency", "frequency_error", "invariance_error", "cycle_period")
    return InvariantCircle(
        coefficients=coefficients,
        rotation_numbers=array_of(group, "circle/rotation_numbers", np.float64, (d,)),
        rotation_errors=array_of(group, "circle/rotation_errors", np.float64, (d,)),
        **{name: float(array_of(group, f"circle/{name}", np.float64, ())) for name in numbers},
    )


def _read_torus(group: h5py.Group, d: int) -> InvariantTorus:
    coefficients = array_of(group, "torus/coefficients", np.complex128, (d, None, None))
    if coefficients.shape[1] != coefficients.shape[2] or coefficients.shape[1] % 2 == 0:
        raise ValueError(f"{group.name} has Fourier coefficients of shape {coefficients.shape}")
    return InvariantTorus(
        frequencies=array_of(group, "torus/frequencies", np.float64, (2,)),
        frequency_errors=array_of(group, "torus/frequency_errors", np.float64, (2,)),
        rotation_numbers=array_of(group, "torus/rotation_numbers", np.float64, (d,)),
        rotation_errors=array_of(group, "torus/rotation_errors", np.float64, (d,)),
        coefficients=coefficients,
        invariance_error=float(array_of(group, "torus/invariance_error", np.float64, ())),
    )
