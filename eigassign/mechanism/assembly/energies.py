"""Where a mode has its energy: K and M as sums over links, drives, springs, weight and bodies.

K = Σ K_c over links, drives, springs and the weight, M = Σ M_c over links, bodies and drives. With
φ a mode of K φ = λ M φ, φᵀMφ = 1, the shares

    φᵀ K_c φ / λ   and   φᵀ M_c φ

are 1 together, and φᵀ K_c φ/λ = ∂ ln λ/∂ ln k where k is a factor of K_c. The share of the weight
is negative where it softens.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import add_drives, compiled_pattern, local_links
from eigassign.mechanism.assembly.congruence import add_links
from eigassign.mechanism.assembly.node_motion import add_springs
from eigassign.mechanism.assembly.pencil import AffineEntries, Pencil, theta_at
from eigassign.mechanism.elements.bodies import add_bodies
from eigassign.mechanism.elements.mesh import Entries, Term
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.compiler import Program

Floats = NDArray[np.float64]
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
