"""Where the rigid links are in the world: for drawing, and for inverse kinematics.

For each link the world rotation R_w = R_w,base R and origin o_w = o_w,base + R_w,base X_b follow
down the tree of joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.kinematics import Kinematics, node_position
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.tip_chain import TipChain
from eigassign.series.program import Samples
from eigassign.series.table import Table, compile_table

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Poses:
    """World frames of all links as functions of x = (q, y)."""

    links: tuple[str, ...]
    bases: tuple[int, ...]  # index of the base link, -1 for the ground
    coordinates: tuple[int | None, ...]  # of each link's joint
    joints: tuple[str, ...]
    axes: Floats  # (n_links, 3) of each link's joint, in its frame
    table: Table  # per link: R_w (9), o_w (3), end position in the link's frame (3)
    to_program: Floats
    shift: Floats
    relative: Floats  # (n_q, n_q)

    def frames(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """R_w (n, n_links, 3, 3), o_w and end nodes in world (n, n_links, 3), at x (n, n_x)."""
        z = self.to_program @ np.atleast_2d(x).T + self.shift[:, None]
        rows = self.table.evaluate(Samples(), z).T
        rows = np.broadcast_to(rows, (z.shape[1], rows.shape[1])).reshape(z.shape[1], -1, 15)
        R, origin = rows[..., :9].reshape(*rows.shape[:2], 3, 3), rows[..., 9:12]
        end = origin + np.einsum("...ij,...j->...i", R, rows[..., 12:])
        return R, origin, end

    def lines(self, x: Floats) -> Floats:
        """Start and end of every link, (n, n_links, 2, 3) in m."""
        _, origin, end = self.frames(x)
        return np.stack([origin, end], axis=2)

    def position(self, x: Floats, link: str, node: str) -> Floats:
        """World position (n, 3) of a link's start or end, in m."""
        lines = self.lines(x)
        return np.asarray(lines[:, self.links.index(link), 1 if node == "end" else 0])

    def jacobian(self, x: Floats, link: str, node: str) -> Floats:
        """∂position/∂q (n, 3, n_q): Σ over the joints below of (axis × lever) ∂s/∂q."""
        R, origin, end = self.frames(x)
        k = self.links.index(link)
        tip = end[:, k] if node == "end" else origin[:, k]
        by_joint = np.zeros((len(tip), 3, len(self.relative)))
        while k >= 0:
            at = self.coordinates[k]
            if at is not None:
                by_joint[:, :, at] = np.cross(R[:, k] @ self.axes[k], tip - origin[:, k])
            k = self.bases[k]
        return np.asarray(by_joint @ self.relative)


def build_poses(case: CaseFile, parameters: Parameters, motion: Kinematics) -> Poses:
    """Compile the world frames of every link."""
    frames: dict[str, tuple[NDArray[np.object_], NDArray[np.object_]]] = {}
    scalars: list[object] = []
    for p in motion.placements:
        R, o = p.rotation, p.origin
        if p.base is not None:
            R_base, o_base = frames[p.base[0]]
            R, o = R_base @ R, o_base + R_base @ o
        frames[p.link] = (R, o)
        scalars += [*R.ravel(), *o, *node_position(case, parameters, p.link, "end")]
    n_q, n_y = len(parameters.coordinates), len(parameters.design)
    links = tuple(p.link for p in motion.placements)
    to_program = np.eye(n_q + n_y)
    to_program[:n_q, :n_q] = motion.relative
    return Poses(
        links=links,
        bases=tuple(-1 if p.base is None else links.index(p.base[0]) for p in motion.placements),
        coordinates=tuple(p.coordinate for p in motion.placements),
        joints=tuple(p.joint for p in motion.placements),
        axes=np.array([p.axis for p in motion.placements], dtype=np.float64),
        table=compile_table(parameters.recorder, scalars, n_q + n_y),  # type: ignore[arg-type]
        to_program=to_program,
        shift=np.concatenate([motion.offset, np.zeros(n_y)]),
        relative=motion.relative,
    )


def tip_chain(poses: Poses, motion: Kinematics, tip: str, y: Floats) -> TipChain:
    """The chain that carries the node ``tip`` ("link.end"), at design y, for inverse kinematics."""
    link, _, node = tip.partition(".")

    def at(q: Floats) -> Floats:
        return np.hstack([q, np.broadcast_to(y, (len(q), len(y)))])

    names = {p.coordinate: p.joint for p in motion.placements if p.coordinate is not None}
    return TipChain(
        position=lambda q: poses.position(at(q), link, node)[:, :2],
        jacobian=lambda q: poses.jacobian(at(q), link, node)[:, :2],
        joints=tuple(names[i] for i in range(len(motion.offset))),
        relative_map=(motion.relative, motion.offset),
    )
