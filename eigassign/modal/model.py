"""The model of a case: its affine pencil with names, exact frequencies and matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats, Ints
from eigassign.brief import cut, named
from eigassign.case.case_file import CaseFile
from eigassign.errors import UsageError
from eigassign.mechanism.assembly.build import build_pencil, local_links, refined, with_reduction
from eigassign.mechanism.assembly.dynamics.under_load import (
    StiffnessUnderLoad,
    stiffness_under_load,
)
from eigassign.mechanism.assembly.held import Held
from eigassign.mechanism.assembly.mode_shapes import NodeShape, StrandShape, TotalMass, shapes
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.links import LinkMesh
from eigassign.mechanism.forces import DriveForces, drive_forces
from eigassign.mechanism.kinematics.forward import Kinematics, LinkFrames
from eigassign.mechanism.kinematics.parameters import Label
from eigassign.modal.arguments import samples
from eigassign.modal.exact.inertia import require_standing
from eigassign.modal.exact.solver import eigenvalues, exact_slopes, modes
from eigassign.modal.mesh_error import (
    FINE,
    SolidLinks,
    mesh_error,
    solid_error,
    standing_frequencies,
)
from eigassign.process import one_thread


@dataclass(frozen=True)
class ModeShapes:
    """Exact modes at one pose and design as motions; see `Model.shapes`."""

    frequencies: Floats  # (count,) in Hz
    strands: tuple[StrandShape, ...]
    nodes: Mapping[tuple[str, str], NodeShape]

    def __repr__(self) -> str:
        hz = ", ".join(f"{each:.6g}" for each in self.frequencies)
        return cut(f"<ModeShapes: {hz} Hz; {len(self.strands)} strands, {len(self.nodes)} nodes>")


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism as functions of its coordinates q (rad or m) and design parameters y (SI).

        K(q, y) φ = λ M(q, y) φ,  K = Σ_j θ_j(q, y) K_j,  M likewise, f = √λ / 2π      (eq. 1)

    q is one sample (n_q,) or many (n, n_q) in the order of ``q_names``, y (n_y,) or (n, n_y) in
    that of ``y_names``. Methods raise UsageError for wrong shapes, and MechanismError or
    TravelError where the mechanism has no modes, or a carriage leaves its beam.
    """

    pencil: Pencil
    poses: LinkFrames
    motion: Kinematics
    total_mass: TotalMass
    q_names: tuple[str, ...]
    y_names: tuple[str, ...]
    meshes: Mapping[str, LinkMesh]  # of each link, reduced where that is asked for
    solids: SolidLinks | None = None
    held: Held | None = None  # of the pencil

    def __repr__(self) -> str:
        return (
            f"<Model: {self.n_dof} degrees of freedom, {self.n_rigid} of them rigid; "
            f"q = {named(self.q_names)}, y = {named(self.y_names)}>"
        )

    @property
    def n_rigid(self) -> int:
        """Number of rigid-body modes: the free coordinates."""
        return len(self.pencil.rigid)

    @property
    def is_meshed(self) -> bool:
        """True where a link consists of beams."""
        return any(mesh.whole.strands for mesh in self.meshes.values())

    @property
    def is_reduced(self) -> bool:
        """True where Craig-Bampton made a link smaller."""
        return any(mesh.reduction for mesh in self.meshes.values())

    @property
    def n_dof(self) -> int:
        """Order of K and M of eq. (1)."""
        return self.pencil.n_dof

    @cached_property
    def whole(self) -> Pencil:
        """K and M with no link reduced."""
        if not self.is_reduced:
            return self.pencil
        whole = {name: mesh.whole for name, mesh in self.meshes.items()}
        return self._rebuilt(with_reduction(self.poses.case, dict.fromkeys(self._reducible)), whole)

    @cached_property
    def bent(self) -> Pencil | None:
        """K and M with imported matrices that bend under weight between their nodes, if any do."""
        links = self.poses.case.mechanism.links.values()
        if self.pencil.weight is None or all(link.type != "superelement" for link in links):
            return None
        return self._rebuilt(self.poses.case, self.meshes, bent=True)

    def refined(self, factor: float = 2.0) -> Model:
        """The model with ``factor`` times the elements in every beam, no beam reduced."""
        if factor not in self._refined:
            beams = {name for name, mesh in self.meshes.items() if mesh.whole.strands}
            whole = dict.fromkeys(beams.intersection(self._reducible))
            case = refined(with_reduction(self.poses.case, whole), factor)[0]
            others = {name: mesh for name, mesh in self.meshes.items() if name not in beams}
            same = factor == 1.0 and not whole
            pencil = self.pencil if same else self._rebuilt(case, others)
            frames = replace(self.poses, case=case)
            self._refined[factor] = replace(self, pencil=pencil, poses=frames, meshes=others)
        return self._refined[factor]

    @cached_property
    def _refined(self) -> dict[float, Model]:
        return {}

    @property
    def _reducible(self) -> list[str]:
        links = self.poses.case.mechanism.links.items()
        return [name for name, link in links if getattr(link, "reduce_to", None) is not None]

    def _rebuilt(self, case: CaseFile, known: Mapping[str, LinkMesh], bent: bool = False) -> Pencil:
        given = case, self.poses.parameters, self.motion
        return build_pencil(*given, local_links(*given, known), bent, self.held)

    def holding(self, node: str, direction: Sequence[float]) -> Model:
        """The mechanism with a node ``link.node`` held along a direction of the ground.

        Its modes are the antiresonances of that node's response to a force along it. Raises
        MechanismError where a coordinate is free, or nothing gives way there.
        """
        own = replace(self, held=Held(node, tuple(map(float, direction))))
        return replace(own, pencil=own._rebuilt(self.poses.case, self.meshes))

    @cached_property
    def under_load(self) -> StiffnessUnderLoad:
        """The stiffness that loads add, whatever they are."""
        return stiffness_under_load(self.poses.case, self.poses.parameters, self.motion)

    def x(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(q, y) as rows (n_samples, n_q + n_y); raises UsageError for a wrong shape."""
        return samples(q, y, len(self.q_names), len(self.y_names))

    def one(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """x of one sample, (1, n_q + n_y); raises UsageError for several."""
        x = self.x(q, y)
        if len(x) != 1:
            raise UsageError(f"this is for one sample of q and y, not {len(x)}")
        return x

    def require_standing(
        self, q: ArrayLike, y: ArrayLike, label: Label = "sample {}".format
    ) -> None:
        """Raise for the first sample k, ``label(k)``, where a rider leaves its beam: TravelError.

        MechanismError for the first that falls under its weight, or buckles.
        """
        x = self.x(q, y)
        if self.pencil.rails is not None:
            z = self.pencil.to_program @ x.T + self.pencil.shift[:, None]
            self.pencil.rails.require(z, x, label)
        if self.pencil.weight is not None:
            require_standing(self.pencil, self.pencil.theta(x), x, label)

    @one_thread
    def frequencies(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> Floats:
        """Exact frequencies of the lowest elastic modes, (n_samples, count) in Hz."""
        return np.sqrt(eigenvalues(self.pencil, self.x(q, y), count)) / (2.0 * np.pi)

    @one_thread
    def modes(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> tuple[Floats, Floats]:
        """Frequencies (n_samples, count) in Hz and mass-normalised modes (…, n_dof, count)."""
        found = modes(self.pencil, self.x(q, y), count)
        return np.sqrt(found.lam) / (2.0 * np.pi), found.phi

    @one_thread
    def slopes(
        self, q: ArrayLike, y: ArrayLike, count: int = 3, wanted: ArrayLike | None = None
    ) -> tuple[Floats, Floats]:
        """λ (n_samples, count) of the lowest elastic modes in rad²/s², and ∂λ/∂x, x = (q, y).

        ∂λ/∂x (n_samples, count, n_x) is taken where ``wanted`` (n_x,) is not 0, everywhere without
        it; else it is 0. Where modes meet it is that of the mode which the solver returns.
        """
        x = self.x(q, y)
        where = np.ones(x.shape[1]) if wanted is None else wanted
        return exact_slopes(self.pencil, x, count, where)[:2]

    def mass(self, y: ArrayLike) -> float:
        """Mass of all links and bodies in kg, those that never move included, at a design (n_y,).

        Raises UsageError for a wrong shape, and for properties that no mechanism can have.
        """
        return self.total_mass(self._design(y))[0]

    @cached_property
    def drives(self) -> DriveForces:
        """What the drives exert along trajectories, `DriveForces`."""
        return drive_forces(self.poses.case, self.poses.parameters, self.motion)

    def _design(self, y: ArrayLike) -> Floats:
        q = np.zeros(len(self.q_names))
        q[len(q) - len(self.total_mass.loads) :] = self.total_mass.loads
        x = self.one(q, y)
        if self.pencil.limits is not None:
            self.pencil.limits.require(x)
        return x[0, len(self.q_names) :]

    @one_thread
    def truncation_error(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Floats:
        """By how much reduced links raise frequencies, relative, (n_samples, n_modes).

        Measured against the whole links, each sample by an exact solve of these, which is kept;
        zero without reduced ones, infinite where the whole ones buckle.
        """
        x, highest = self.x(q, y), max(modes)
        if not self.is_reduced:
            return np.zeros((len(x), len(modes)))
        known = self._whole_hz
        for row in x:
            if len(known.get(row.tobytes(), ())) < highest:
                known[row.tobytes()] = standing_frequencies(self.whole, row[None], highest)[0]
        exact = np.array([known[row.tobytes()][:highest] for row in x]) / (2.0 * np.pi)
        error = np.abs(self.frequencies(q, y, highest) / exact - 1.0)[:, np.array(modes) - 1]
        return np.where(np.isfinite(error), error, np.inf)

    @cached_property
    def _whole_hz(self) -> dict[bytes, Floats]:
        return {}

    def discretisation_error(
        self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)
    ) -> Floats:
        """By how much the mesh raises frequencies, about, relative, (n_samples, n_modes).

        Zero without beams and solids; of beams measured by meshes of twice the elements and more,
        of solids by functions of the next degree; infinite where nothing is known.
        """
        error = self.beam_error(q, y, modes)
        if self.solids is None:
            return error
        return (1.0 + error) * (1.0 + solid_error(self.solids, self.x(q, y), modes)) - 1.0

    @one_thread
    def beam_error(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Floats:
        """The part of the beams in `discretisation_error`."""
        x = self.x(q, y)
        if not self.is_meshed:
            return np.zeros((len(x), len(modes)))
        fewest = min(refined(self.poses.case, 1.0)[1])
        certain = self.pencil.rails is None and self.pencil.weight is None and fewest > 1
        fine = certain and fewest >= FINE
        return mesh_error(lambda factor: self.refined(factor).pencil, x, modes, certain, fine)

    def coarsest(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int]) -> Ints:
        """The samples at which twice the elements change one of the modes most."""
        x = self.x(q, y)
        hz = [standing_frequencies(self.refined(k).pencil, x, max(modes)) for k in (1.0, 2.0)]
        change = np.abs(hz[1] / hz[0] - 1.0)[:, np.array(modes) - 1]
        return np.unique(change.argmax(axis=0))

    def shapes(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> ModeShapes:
        """The lowest elastic modes at one sample as motions of all nodes and beams, for drawing.

        ``.frequencies`` (count,) in Hz; ``.strands``: per beam ``.link``, points ``.places``
        (n_points, 2 or 3) in m and their displacements ``.motions`` (count, n_points, 2 or 3) in
        the mass-normalised modes (m per √kg m), rigid motion φ_q included; ``.nodes`` by
        (link, node). Raises UsageError for several samples.
        """
        self.one(q, y)
        return self.shapes_along(q, y, count)[0]

    def shapes_along(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> tuple[ModeShapes, ...]:
        """The shapes at each of several samples, for a picture that moves."""
        hz, phi = self.modes(q, y, count)
        found = shapes(self.poses, self.x(q, y), phi)
        return tuple(
            ModeShapes(own, one.strands, one.nodes) for own, one in zip(hz, found, strict=True)
        )

    def matrices(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """M and K of eq. (1) for one sample, dense (n_dof, n_dof), unknowns [u; q̇].

        Raises UsageError for several samples.
        """
        x = self.one(q, y)
        K, M = self.pencil.matrices(self.pencil.theta(x))
        return M[0], K[0]


def as_model(given: object) -> Model:
    """The model itself; UsageError for anything else, such as the case that it comes from."""
    if isinstance(given, Model):
        return given
    raise UsageError(f"a Model is needed, not {type(given).__name__}: case.model() is one")
