"""The total mass of a mechanism, and where a mode has its energy.

Every link with its bodies moves as one in a translation e of its nodes, so that its mass is eᵀ m e
with the link's own mass matrix m = Σ μ_i(y) m_i. Links held by the ground count as well; what a
drive reflects through its gear is no mass.

K = Σ K_c over links, drives, springs and the weight, M = Σ M_c over links, bodies and drives. With
φ a mode of K φ = λ M φ, φᵀMφ = 1, the shares

    φᵀ K_c φ / λ   and   φᵀ M_c φ

are 1 together, and φᵀ K_c φ/λ = ∂ ln λ/∂ ln k where k is a factor of K_c. The share of the weight
is negative where it softens.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import add_drives, compiled_pattern, local_links
from eigassign.mechanism.assembly.congruence import add_links
from eigassign.mechanism.assembly.node_motion import add_springs
from eigassign.mechanism.assembly.pencil import AffineEntries, Pencil, theta_at
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, Term, add_bodies
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.loop_closure import reference
from eigassign.mechanism.kinematics.parameters import ModelParameters, written_loads
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledTable, Program, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TotalMass:
    """Σ_links Σ_i μ_i(y) eᵀ m_i e; it does not depend on the pose."""

    table: CompiledTable  # one row
    at: Floats  # z = (s, y) (n_z,) where the mechanism can be put together
    n_y: int
    loads: Floats  # (n_loads,) that it is with: as written

    @property
    def is_affine(self) -> bool:
        """True where it is of degree 1 in y at most, by its form."""
        return self.table.program.is_affine(np.arange(len(self.at)) >= len(self.at) - self.n_y)

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """The mass in kg of a design y (n_y,), and its slope (n_y,) in kg per SI unit of y."""
        first = len(self.at) - self.n_y
        z = np.zeros((len(self.at), 1 + self.n_y))
        z[:, 0] = self.at
        z[first:, 0] = y
        z[first:, 1:] = np.eye(self.n_y)
        row = self.table.evaluate(Tangents(1, self.n_y), z)[0]
        return float(row[0]), row[1:]


def total_mass(
    case: CaseFile, parameters: ModelParameters, meshes: Iterable[LinkMesh]
) -> TotalMass:
    """The mass of the links of a mechanism, each with all its dofs and its bodies."""
    mass: Scalar = 0.0
    for mesh in meshes:
        # Translation does not depend on y: the first column of all terms of N is one of numbers.
        e = np.sum([term.matrix[:, [0]].toarray()[:, 0] for term in mesh.rigid], axis=0)
        for term in mesh.mass:
            mass = mass + term.coefficient * float(e @ (term.matrix @ e))
    at = reference(case, parameters)
    table = compile_table(parameters.recorder, [mass], len(at))
    return TotalMass(table, at, len(parameters.design), written_loads(case))


Ints = NDArray[np.intp]
WEIGHT = "weight"


@dataclass(frozen=True, eq=False)
class EnergyForms:
    """K_c and M_c by the key paths of what they are of, on one pattern with one program."""

    rows: Ints
    columns: Ints
    strain: Mapping[str, sparse.csr_array]  # (n_nonzeros, 1 + n_theta)
    kinetic: Mapping[str, sparse.csr_array]
    program: Program

    def shares(
        self, pencil: Pencil, x: Floats, lam: Floats, phi: Floats
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """The shares (n, m) of modes λ (n, m), φ (n, n_dof, m) at x (n, n_x): strain, kinetic."""
        theta = theta_at(self.program, pencil.to_program @ x.T + pencil.shift[:, None])

        def energy(weights: sparse.csr_array, rows: Ints, columns: Ints, own: Floats) -> Floats:
            values = np.asarray(weights @ own).T
            found = np.einsum("nem,nem,ne->nm", phi[:, rows], phi[:, columns], values)
            return np.asarray(found)

        at = self.rows, self.columns
        strain = {key: energy(w, *at, theta) / lam for key, w in self.strain.items()}
        kinetic = {key: energy(w, *at, theta) for key, w in self.kinetic.items()}
        if pencil.weight is not None:
            own = pencil.weight.stiffness, pencil.rows, pencil.columns, pencil.theta(x)
            strain[WEIGHT] = energy(*own) / lam
        return strain, kinetic


def energy_forms(case: CaseFile, parameters: ModelParameters, motion: Kinematics) -> EnergyForms:
    """The forms of a case's links, drives, springs and bodies."""
    links, nodes = local_links(case, parameters, motion)
    known = parameters.with_passive(motion.passive)
    strain, kinetic = dict[str, AffineEntries](), dict[str, AffineEntries]()
    mechanism, n_u = case.mechanism, nodes.count
    for placement, link in zip(motion.placements, links, strict=True):
        key, mesh = f"links.{placement.link}", nodes.meshes[placement.link]
        strain[key], kinetic[key] = AffineEntries(), AffineEntries()
        add_links(strain[key], kinetic[key], [link], n_u)
        for name, body in mechanism.bodies.items():
            if body.at.partition(".")[0] != placement.link:
                continue
            alone = mechanism.model_copy(update={"bodies": {name: body}})
            mass = Entries((mesh.n_local, mesh.n_local))
            arms = mesh.positions if "@origin" in mesh.nodes else {}
            one = replace(case, mechanism=alone)
            add_bodies(one, known, placement.link, mass, mesh.nodes, arms)
            kinetic[f"bodies.{name}"] = AffineEntries()
            for M, sign in ((kinetic[f"bodies.{name}"], 1.0), (kinetic[key], -1.0)):
                terms = [Term(term.coefficient * sign, term.matrix) for term in mass.terms()]
                add_links(AffineEntries(), M, [replace(link, stiffness=(), mass=terms)], n_u)
    for name, spring in mechanism.springs.items():
        alone = mechanism.model_copy(update={"springs": {name: spring}})
        K = strain[f"springs.{name}"] = AffineEntries()
        add_springs(K, replace(case, mechanism=alone), parameters, motion, nodes)
    for name in case.coordinates:
        held, carried = AffineEntries(), AffineEntries()
        add_drives(held, carried, case, parameters, motion, n_u, only=name)
        for own, found in ((held, strain), (carried, kinetic)):
            if own.sums:
                found[f"coordinates.{name}.drive"] = own
    each = [*strain.values(), *kinetic.values()]
    n_dof = n_u + len(motion.columns)
    entries = [one.finish(n_u) for one in each]
    rows, columns, weights, program = compiled_pattern(entries, parameters, n_dof)
    return EnergyForms(
        rows,
        columns,
        dict(zip(strain, weights, strict=False)),
        dict(zip(kinetic, weights[len(strain) :], strict=True)),
        program,
    )
