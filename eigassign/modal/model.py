"""The model of a case: its affine pencil with names, exact frequencies and matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.brief import cut, named
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.links import IMPORTED
from eigassign.errors import UsageError
from eigassign.mechanism.assembly.build import build_pencil, has_tapers, refined, with_reduction
from eigassign.mechanism.assembly.dynamics.under_load import (
    StiffnessUnderLoad,
    stiffness_under_load,
)
from eigassign.mechanism.assembly.energies import EnergyForms, energy_forms
from eigassign.mechanism.assembly.inside_links import MeshedLinks, ReducedLinks, SolidLinks
from eigassign.mechanism.assembly.mode_shapes import NodeShape, StrandShape, shapes
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.assembly.total_mass import TotalMass
from eigassign.mechanism.drives import DriveForces, drive_forces
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.link_frames import LinkFrames
from eigassign.mechanism.kinematics.travel_limits import Label
from eigassign.modal.arguments import samples
from eigassign.modal.discretisation import discretisation_error, solid_error
from eigassign.modal.exact.solver import eigenvalues, modes
from eigassign.modal.exact.standing import require_standing
from eigassign.modal.exact.tracking import Tracked, track
from eigassign.modal.slopes import exact_slopes
from eigassign.modal.truncation import compared_error, truncation_error

Floats = NDArray[np.float64]


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
    reduced: ReducedLinks | None = None  # the links that Craig-Bampton made smaller
    meshed: MeshedLinks | None = None  # the links that consist of beams
    solids: SolidLinks | None = None

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
    def is_exact(self) -> bool:
        """True where links are rigid or superelements as they are: neither mesh nor reduction."""
        return self.meshed is None and self.solids is None and self.reduced is None

    @property
    def has_bounds(self) -> bool:
        """True where errors of the mesh are bounds; under gravity, and of solids, estimates."""
        return self.pencil.weight is None and self.solids is None

    @property
    def n_dof(self) -> int:
        """Order of K and M of eq. (1)."""
        return self.pencil.n_dof

    @cached_property
    def whole(self) -> Pencil:
        """K and M with no link of beams reduced."""
        return self.pencil if self.reduced is None else self._rebuilt(self._unreduced)

    @cached_property
    def refinements(self) -> tuple[Pencil, ...]:
        """Under gravity K and M of `whole` links on meshes of 1 and 2 times the elements.

        And of 4 where a carriage takes the curvature at a point, which converges slowly.
        """
        if self.pencil.weight is None:
            return ()
        factors = (2.0,) if self.pencil.rails is None else (2.0, 4.0)
        finer = [self._rebuilt(refined(self._unreduced, factor)[0]) for factor in factors]
        return (self.whole, *finer)

    @cached_property
    def finer(self) -> tuple[CaseFile, Pencil] | None:
        """The case, K and M with twice the elements and no link of beams reduced.

        None where that gives way alike: beams of one section are exact under forces at their ends.
        """
        case = self.poses.case
        if self.pencil.weight is None and self.reduced is None and not has_tapers(case):
            return None
        finer = refined(self._unreduced, 2.0)[0]
        return finer, self.refinements[1] if self.refinements else self._rebuilt(finer)

    @property
    def _unreduced(self) -> CaseFile:
        links = self.poses.case.mechanism.links.items()
        beams = [
            n for n, each in links if getattr(each, "reduce_to", 0) and each.type not in IMPORTED
        ]
        return with_reduction(self.poses.case, dict.fromkeys(beams))

    def _rebuilt(self, case: CaseFile) -> Pencil:
        return build_pencil(case, self.poses.parameters, self.motion)

    @cached_property
    def under_load(self) -> StiffnessUnderLoad:
        """The stiffness that loads add, whatever they are."""
        return stiffness_under_load(self.poses.case, self.poses.parameters, self.motion)

    def x(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(q, y) as rows (n_samples, n_q + n_y); raises UsageError for a wrong shape."""
        return samples(q, y, len(self.q_names), len(self.y_names))

    def one(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """The same of one sample, (1, n_q + n_y); raises UsageError for several."""
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

    def frequencies(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> Floats:
        """Exact frequencies of the lowest elastic modes, (n_samples, count) in Hz."""
        return np.sqrt(eigenvalues(self.pencil, self.x(q, y), count)) / (2.0 * np.pi)

    def modes(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> tuple[Floats, Floats]:
        """Frequencies (n_samples, count) in Hz and mass-normalised modes (…, n_dof, count)."""
        found = modes(self.pencil, self.x(q, y), count)
        return np.sqrt(found.lam) / (2.0 * np.pi), found.phi

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
    def energies(self) -> EnergyForms:
        """The energies of modes by links, drives, springs and bodies, `EnergyForms`."""
        return energy_forms(self.poses.case, self.poses.parameters, self.motion)

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

    def truncation_error(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Floats:
        """By how much reduced links raise frequencies at most, relative, (n_samples, n_modes).

        Zero without reduced links; infinite where nothing can be vouched for. Under gravity
        links of beams are solved whole.
        """
        x = self.x(q, y)
        bounded, error = self.reduced, np.zeros((len(x), len(modes)))
        if self.pencil.weight is not None and self.reduced is not None:
            bounded = self.reduced.imported
            if bounded is None or len(bounded.links) < len(self.reduced.links):
                error = compared_error(self.pencil, self.whole, x, modes)
        if bounded is not None:
            error = (1.0 + error) * (1.0 + truncation_error(bounded, x, modes)) - 1.0
        return error

    def discretisation_error(
        self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)
    ) -> Floats:
        """By how much the mesh raises frequencies at most, relative, (n_samples, n_modes).

        Zero without beams and solids; infinite where the mesh is so coarse that nothing can be
        said. Under gravity an estimate from finer meshes; with solids one from recovered stresses.
        """
        error = self.beam_error(q, y, modes)
        if self.solids is None:
            return error
        return (1.0 + error) * (1.0 + solid_error(self.solids, self.x(q, y), modes)) - 1.0

    def beam_error(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Floats:
        """The part of the beams in `discretisation_error`."""
        x = self.x(q, y)
        if self.meshed is None:
            return np.zeros((len(x), len(modes)))
        return discretisation_error(self.meshed, x, modes, self.reduced, self.refinements).total

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
        """The same at each of several samples, for a picture that moves."""
        hz, phi = self.modes(q, y, count)
        found = shapes(self.poses, self.x(q, y), phi)
        return tuple(
            ModeShapes(own, one.strands, one.nodes) for own, one in zip(hz, found, strict=True)
        )

    def tracked(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Tracked:
        """``modes`` of the first sample followed along the samples by their shapes.

        ``.frequencies`` (n_samples, n_modes) in Hz, ``.swaps``, ``.encounters`` and ``.notes``.
        Neighbours must be neighbours: pass each of ``case.trajectories`` by itself.
        """
        return track(self.pencil, self.x(q, y), modes)

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
