"""Certification of basins: labels that interpolation error could have changed are recomputed with the exact map."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ..._lib.checks import affordable_number, claim_memory, finite_number, real_number, warn_caller
from ..._lib.randomness import Rng, random_seed
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...maps.orbit_batch import NOTHING, Cost
from ..proofs.proof import Proof
from ..record import Basins
from .budget import Budget
from .certificate import Certificate
from .certified_labels import OPEN, CertifiedLabels
from .table_errors import TableErrors
from .undecided import MissedAttractors

_SEARCHES = 8  # certifications of a basin image at most, as further attractors are found


def _is_of(proof: Proof, basins: Basins) -> bool:
    """Tell whether a proof is of these basins, with the same attractors in the same order, and of their parameters."""
    own = proof.basins
    return (
        (own.grid, own.name, own.coordinates, dict(own.params))
        == (basins.grid, basins.name, basins.coordinates, dict(basins.params))
        and np.array_equal(own.labels, basins.labels)
        and len(own.attractors) == len(basins.attractors)
        and all(np.array_equal(a.points, b.points) for a, b in zip(own.attractors, basins.attractors, strict=True))
        and all(low <= basins.params[name] <= high for name, (low, high) in proof.parameters.items())
    )


@checked
def certify(
    basins: Basins,
    audit: int = 1000,
    safety: float = 4.0,
    *,
    max_cost: float = 1.2,
    proof: Proof | None = None,
    rng: Rng = 0,
    progress: bool = False,
) -> Certificate:
    """Identify every label that interpolation error could have changed, and recompute it with the exact map.

    A label is kept if interpolation errors cannot change it.  First, whole cells of the interpolation grid are assigned
    to an attractor: those inside its verified trapping region, and then those whose image, with all errors, meets only
    such cells.  Initial conditions in other cells are iterated together with an ellipsoid that contains all errors made
    so far, propagated by the derivatives of the map, until the ellipsoid lies inside a trapping region or inside cells
    of one attractor.  If that does not happen, the label is recomputed with the exact map, also with an ellipsoid,
    because the exact map has errors of the size of its tolerance.  Finally some random labels that were kept are
    audited by integration.

    The error bound of a period in a cell is `safety` times the largest error estimate of the cell and its neighbours,
    axis by axis, plus the tolerance of the exact map.  This is an argument from measured errors and derivatives, not a
    proof in interval arithmetic; the audit tests it.

    Undecided initial conditions are labelled with the exact map, and those that remain undecided, then or later, are
    searched for further attractors.  If an attractor is found, labels are certified again with it.  Initial conditions
    that are still undecided have no label: they are open, and count in the upper end of the interval.

    Parameters
    ----------
    basins : Basins
        Found by :func:`find_basins` with an interpolated map.
    audit : int, optional
        Number of labels to compare with exact integration.
    safety : float, optional
        Factor by which errors may exceed their estimates.
    max_cost : float, optional
        Largest cost, in direct integrations of the same labels, of a certificate for a flow.  Where the work on some
        initial conditions predicts a larger one, the others are integrated directly, with the evidence DIRECT; all of
        them where the interpolation cells alone would cost too much.  With inf nothing is left out, nor is it where all
        takes a tenth of a second.
    proof : Proof, optional
        What :func:`prove` has proved of these basins: labels of cells that are proved as a whole are kept, with the
        evidence PROVED.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the random choice of these labels.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Certificate
        Labels, the evidence for each, and a confidence interval of the fraction that is still wrong.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or basins without their map or not of an interpolated map.

    Warns
    -----
    UserWarning
        If the audit finds labels that were kept and are wrong.

    Notes
    -----
    On a fractal boundary some labels stay open: orbits separate faster than they converge, and two exact integrators
    differ there as well.  Orbits on a chaotic attractor separate for ever, so that all labels of its basin are
    recomputed.

    Examples
    --------
    >>> from math import pi
    >>> from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, stroboscopic_map
    >>> wells = ForcedSystem(lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.3 * x[1]), {}, 2 * pi, ("x", "v"))
    >>> grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (60, 40))
    >>> icm = interpolated_map(stroboscopic_map(wells), CellGrid((-2, -2), (2, 2), (128, 128)))
    >>> certificate = certify(find_basins(icm, grid))
    >>> certificate.audit.wrong, certificate.open
    (0, 0)
    """
    point_map = basins.point_map
    if point_map is None:
        raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
    if point_map.table is None or point_map.exact is None:
        raise ValueError(
            f"basins were found with {point_map!r}, which is not an interpolated map: there is no interpolation error "
            "to certify against"
        )
    audit = affordable_number("audit", audit, 8 * 4, at_least=1)
    safety = finite_number("safety", safety, at_least=1.0)
    if not real_number("max_cost", max_cost) >= 1.0:
        raise ValueError(
            f"max_cost={max_cost!r}: give a number from 1 on, which direct integration costs; inf for no limit"
        )
    began = time.perf_counter()
    given, total, proved = basins, basins.labels.size, np.zeros(basins.labels.size, bool)
    if proof is not None:
        if not _is_of(proof, basins):
            raise ValueError(f"proof={proof!r} is of other basins: give what prove(basins) returns")
        known = proof.labels
        proved = (known >= 0).ravel()
        basins = replace(basins, labels=np.where(known >= 0, known, basins.labels).astype(basins.labels.dtype))
    claim_memory(f"evidence for {total:,} initial conditions", 6 * total, "take fewer initial conditions")
    claim_memory(
        f"error bounds of {point_map.table}", TableErrors.memory(point_map.table.grid), "take fewer interpolation cells"
    )
    budget = Budget.of(basins, max_cost)
    bounds = None if budget.is_spent_on_cells else TableErrors.of(point_map, safety, progress)
    search = MissedAttractors(basins, progress)
    search.among(np.flatnonzero(np.isin(basins.labels, OPEN)))
    run = CertifiedLabels(search, bounds, budget, NOTHING, proved)
    seed = random_seed(rng)
    checked = run.certify(audit, seed)
    for again in range(1, _SEARCHES):
        # What was shown to go to one attractor may have one on its way that was not known.
        if not search.among(run.undecided):
            break
        run = CertifiedLabels(search, bounds, budget, run.tally, proved)
        checked = run.certify(audit, seed + again)
    if checked.wrong:
        warn_caller(
            f"{checked.wrong} of {checked.compared:,} labels that were kept are wrong by direct integration: the "
            f"interpolation grid {point_map.table.grid} misses a part of the map; give it more cells, or raise "
            f"safety={safety:g}"
        )
    shape, kept = basins.labels.shape, 1.0 - (run.redone + np.count_nonzero(proved)) / total
    return Certificate(
        basins=replace(
            search.basins,
            labels=run.labels.reshape(shape),
            settling_time=run.times.reshape(shape),
        ),
        evidence=run.evidence.reshape(shape),
        redone=run.redone,
        changed=int(np.count_nonzero(run.labels != search.before(given).ravel())),
        audit=checked,
        wrong=(kept * checked.low, kept * checked.high + np.count_nonzero(run.labels == Label.UNDECIDED) / total),
        cost=Cost(
            seconds=time.perf_counter() - began,
            steps=run.tally.steps + search.tally.steps,
            evaluations=run.tally.evaluations + search.tally.evaluations,
            look_ups=run.tally.look_ups + search.tally.look_ups,
        ),
    )
