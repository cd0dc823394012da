"""Responses along the trajectory: dynamic stiffness, modal constants, speeds that are free.

The frequencies drawn are a quarter of the least damping ratio apart, if that are not too many. What
is least is looked for at those of each sample's modes, too, and as far beside as ζ widens a peak.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats, Ints
from eigassign.case.schema.targets import DrawnResponse, PushedNode
from eigassign.case.units import SI, Given
from eigassign.errors import MechanismError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.exact.tracking import links
from eigassign.modal.response import (
    NEAR,
    ModalResponse,
    Shaken,
    dampings,
    modal_response,
    unit_forces,
)
from eigassign.study.results import FreeSpeeds, ResponseRow
from eigassign.study.scene import Scene

UNIT = SI("N/m", Given(1e6, "1 N/um"))  # as machines are rated
FEWEST, MOST = 200, 4000  # frequencies of a response


def study_responses(scene: Scene, y: Floats) -> Iterator[ResponseRow]:
    """What the case draws, of design y (n_y,), beside the initial one where that is another.

    Raises MechanismError where a coordinate is free, and where nothing gives way.
    """
    keys, model, path = scene.file.responses, scene.model, scene.path
    every = dict.fromkeys((p.at, p.direction) for key in keys for p in key.places)
    nodes = {at: [d for node, d in every if node == at] for at, _ in every}
    order = [(at, d) for at, own in nodes.items() for d in own]
    designs = [y] if np.array_equal(y, scene.initial) else [y, scene.initial]
    samples = [model.x(path.at(each)[0], each) for each in designs]
    own, damped = unit_forces(model, nodes), dampings(model)
    for key in keys:
        a, b = (order.index((p.at, p.direction)) for p in key.places)
        highest = 2.0 * np.pi * key.highest * key.harmonics
        each = [[modal_response(model, d, own, x, highest) for d in damped] for x in samples]
        found, hz = each[0], _frequencies(key, each[0])
        (w, H), *others = (_looked_at(one, 2.0 * np.pi * hz, a, b) for one in each)
        size = np.abs(H).max(axis=0)
        if not size.any():
            raise MechanismError("response", f"nothing gives way: {key.name}")
        k, j = np.unravel_index(size.argmax(), size.shape)
        ends, mesh = 2.0 * np.pi * hz[[0, -1]], None
        endless = _is_endless(found, ends, a, b)
        if model.is_meshed and key.seen is None and not endless:
            none, worst = np.zeros(samples[0].shape[1], dtype=bool), samples[0][[k]]
            coarse, fine = (
                Shaken.of(model, key.at, key.direction, ends, finer).at(worst, none)[0].max()
                for finer in (False, True)
            )
            mesh = abs(float(fine / coarse) - 1.0)
        shown = max(4, int((found[0].lam < (2.0 * highest) ** 2).any(axis=0).sum()))
        modes_hz = np.sqrt(found[0].lam[:, :shown]) / (2.0 * np.pi)
        zeta = [m.zeta[:, :shown] for m in found]
        ratios = tuple(zeta if len(zeta) < 2 else (np.min(zeta, axis=0), np.max(zeta, axis=0)))
        before = [np.abs(one).max(axis=(0, 1)) for _, one in others]  # (k,)
        yield ResponseRow(
            name=key.name,
            unit=UNIT,
            least=0.0 if endless else 1.0 / float(size[k, j]),
            at_hz=float(w[k, j]) / (2.0 * np.pi),
            at_s=float(path.time_s[k]),
            before=next((1.0 / float(one.max()) for one in before), None),
            real=-np.inf if endless else float(H.real.min()),
            mesh=mesh,
            free=tuple(_free(key, modes_hz, ratios)),
            frequency_hz=hz,
            response=H[..., : len(hz)],
            initial=next((1.0 / one[: len(hz)] for one in before), None),
            places=tuple(PushedNode(at=at, direction=d).name for at, d in order),
            constants=found[0].beta[:, :shown],
            modes_hz=modes_hz,
            ratios=ratios,
            tracked=_tracked(found[0], path, shown),
        )


def _looked_at(
    found: Sequence[ModalResponse], omega: Floats, a: int, b: int
) -> tuple[Floats, NDArray[np.complex128]]:
    """Frequencies (n, k + p) in rad/s, first the k given; and H there, (dampings, n, k + p)."""
    near = (one.peaks(omega[0], omega[-1], (-1.0, 0.0, 1.0)) for one in found)
    w = np.hstack([np.tile(omega, (len(found[0].x), 1)), *near])
    return w, np.array([one.at(w, a, b) for one in found])


def _is_endless(found: Sequence[ModalResponse], ends: Floats, a: int, b: int) -> bool:
    """Whether a mode without damping that is seen passes a frequency of the range on the way."""
    own, seen = np.sqrt(found[0].lam), np.abs(found[0].beta[..., a] * found[0].beta[..., b])
    met = (own.max(axis=0) >= ends[0]) & (own.min(axis=0) <= ends[1])
    undamped = np.min([one.zeta for one in found], axis=(0, 1)) < NEAR
    return bool((met & undamped & (seen > NEAR * seen.max()).any(axis=0)).any())


def _frequencies(key: DrawnResponse, found: Sequence[ModalResponse]) -> Floats:
    least = min(float(m.zeta.min(initial=1.0, where=m.zeta > 0.0)) for m in found)
    wanted = np.clip(4.0 / least * np.log(key.highest / key.lowest), FEWEST, MOST)
    count = int(wanted) if key.highest > key.lowest else 1
    return np.geomspace(key.lowest, key.highest, count)


def _free(key: DrawnResponse, hz: Floats, ratios: Sequence[Floats]) -> Iterator[FreeSpeeds]:
    """Speeds whose first harmonic is drawn less those of modes: f (1 ± ζ), all along the path."""
    if key.teeth is None:
        return
    zeta = np.maximum.reduce(ratios)
    low, high = (hz * (1.0 - zeta)).min(axis=0), (hz * (1.0 + zeta)).max(axis=0)
    shares = 1.0 / np.arange(1, key.harmonics + 1)
    taken = sorted(zip(np.outer(shares, low).flat, np.outer(shares, high).flat, strict=True))
    at, rpm = key.lowest, 60.0 / key.teeth
    for start, end in [*taken, (key.highest, key.highest)]:
        if (until := min(float(start), key.highest)) > at:
            yield FreeSpeeds(key.name, rpm * at, rpm * until, key.teeth)
        at = max(at, float(end))


def _tracked(found: ModalResponse, path: Trajectories, count: int) -> Ints:
    """Modes by likeness to those of the sample before, (φᵀMφ')², numbered where a path begins."""
    from scipy.optimize import linear_sum_assignment

    phi = found.phi[..., :count]
    alike = links(found.model.pencil, found.x[1:], phi[:-1], phi[1:])[0] ** 2
    numbers = np.tile(np.arange(1, 1 + phi.shape[2]), (len(phi), 1))
    for k in sorted({*range(1, len(phi))} - {rows.start for rows in path.rows}):
        numbers[k] = numbers[k - 1][linear_sum_assignment(-alike[k - 1])[1]]
    return numbers
