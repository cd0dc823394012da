"""A solid link: a part by its mesh, E × K and ρ × M, with the nodes that stand for its surfaces.

In a plane its nodes keep u_x, u_y and θ_z; u_z, θ_x and θ_y are held.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.elements.bodies import add_bodies
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, Lost, Term, chain_dofs
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.rotations import DOFS, vector
from eigassign.mechanism.solids.part import solid_part
from eigassign.series.expression import Expression, Scalar


def solid_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """The mesh of a solid: its nodes' dofs first, node by node; then those of its mesh.

    Raises MechanismError for a mesh that cannot be read, or does not fit its nodes.
    """
    link: Any = case.mechanism.links[name]
    given: Any = case.mechanism.materials[link.material]
    part, places = solid_part(link, float(given.poissons_ratio), f"mechanism.links.{name}")
    space, count = case.mechanism.space, len(places)
    kept = list(DOFS[space])
    own = np.concatenate([6 * k + np.array(kept) for k in range(count)])
    own = np.append(own, np.arange(6 * count, len(part.rigid)))
    nodes = dict(zip(places, chain_dofs(count, space), strict=True))
    E, rho = (
        parameters.number(f"materials.{link.material}.{key}", getattr(given, key))
        for key in ("youngs_modulus", "density")
    )
    bodies = Entries((len(own),) * 2)
    add_bodies(case, parameters, name, bodies, nodes)

    def gram(v: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return part.lacked.gram(part.motion[:, own] @ v)

    return LinkMesh(
        len(own),
        nodes,
        {key: vector(place.tolist()) for key, place in places.items()},
        [_term(E, part.stiffness[own][:, own])],
        [_term(rho, part.mass[own][:, own]), *bodies.terms()],
        [Term(1.0, sparse.csr_array(part.rigid[own][:, kept]))],
        lost=Lost(E, rho, gram, lambda: part.lacked.one_layer),
    )


def _term(coefficient: Scalar, matrix: sparse.csr_array) -> Term:
    """coefficient × matrix, a number in the matrix."""
    if isinstance(coefficient, Expression):
        return Term(coefficient, sparse.csr_array(matrix))
    return Term(1.0, sparse.csr_array(matrix * coefficient))
