"""From a case to its affine pencil: unknowns, links, springs, drives, coefficient functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.links import IMPORTED
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, add_links
from eigassign.mechanism.assembly.held import Held, substitution
from eigassign.mechanism.assembly.loads.statics import Loaded
from eigassign.mechanism.assembly.loads.weight import add_weight
from eigassign.mechanism.assembly.node_motion import NodeMotions, add_springs, close_rigid_loops
from eigassign.mechanism.assembly.pencil import (
    AffineEntries,
    Entries,
    Pencil,
    Weight,
    joined,
    pattern,
)
from eigassign.mechanism.assembly.rigid_body_modes import apart_from_rigid, separated, swinging
from eigassign.mechanism.elements.craig_bampton import reduced_where_asked
from eigassign.mechanism.elements.links import (
    LinkMesh,
    Term,
    beam_mesh,
    copies_of,
    frame_mesh,
    rigid_link,
)
from eigassign.mechanism.kinematics.forward import Kinematics, Placement
from eigassign.mechanism.kinematics.joints import DOFS
from eigassign.mechanism.kinematics.loop_closure import closed_kinematics, reference
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    link_type,
    property_limits,
    rails,
)
from eigassign.mechanism.kinematics.parameters import parameters as variables
from eigassign.mechanism.kinematics.topology import Topology, build_tree, coordinates
from eigassign.series.compiler import Program, compile_program
from eigassign.series.expression import Scalar

SMALLEST = 1e-12  # η of a material without, in a frame where others have some: not 0/0
LOWEST = 1e-9  # Hz: no part has a mode below, so that it keeps its nodes alone
LocalLinks: TypeAlias = tuple[list[LocalLink], NodeMotions]


def erls_motion(case: CaseFile, parameters: ModelParameters) -> Kinematics:
    """ERLS motion of a case: the tree walked, loops closed, rigid-body motions among the columns.

    Raises MechanismError for what cannot be placed, moved or closed.
    """
    tree = build_tree(case)
    motion = closed_kinematics(case, parameters, tree, coordinates(case, tree))
    moves = [c.moves for c in case.coordinates.values()]
    free = tuple(k for k, i in enumerate(motion.columns) if moves[i] == "free")
    if free and getattr(case.mechanism, "springs", None):
        motion = separated(case, parameters, motion, free)
    else:
        motion = replace(motion, rigid=free)
    g = gravity(case)
    if g is None or not free:
        return motion
    return swinging(case, parameters, motion, rigid_links(case, parameters, motion), g)


def gravity(case: CaseFile) -> Floats | None:
    """g (3,) in m/s², where it counts."""
    given = case.mechanism.gravity
    return np.array([*given, 0.0][:3]) if isinstance(given, tuple) else None


def build_pencil(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    local: LocalLinks | None = None,
    bent: bool = False,
    held: Held | None = None,
) -> Pencil:
    """Assemble K and M of eq. (1) for a mechanism; raises MechanismError naming what is wrong.

    ``local`` is what `local_links` gave, where that is known already; ``bent`` as in `Loaded`;
    ``held`` is a node that cannot move along a direction.
    """
    links, nodes = local_links(case, parameters, motion) if local is None else local
    stiffness, mass = AffineEntries(), AffineEntries()
    add_links(stiffness, mass, links, nodes.count)
    add_springs(stiffness, case, parameters, motion, nodes)
    g, weight, K_g = gravity(case), AffineEntries(summed=True), None
    if g is not None:
        known = parameters.with_passive(motion.passive)
        scene = Loaded(case, known, motion, by_name(motion, links), nodes, bent)

        def coarse() -> Loaded:
            few, nodes = local_links(in_few_elements(case), parameters, motion)
            return replace(scene, links=by_name(motion, few), nodes=nodes)

        add_weight(weight, scene, g, coarse)
    add_drives(stiffness, mass, case, parameters, motion, nodes.count)
    K, M = stiffness.finish(nodes.count), mass.finish(nodes.count)
    if g is not None:
        n_dof = nodes.count + len(motion.columns)
        rigid = [nodes.count + k for k in motion.rigid]
        K_g = apart_from_rigid(weight.finish(nodes.count), M, case, known, rigid, n_dof)
    n_u = nodes.count
    if held is not None:
        staying = substitution(held, case, parameters, motion, nodes)
        K = K if K_g is None else joined(K, K_g)
        K, M, K_g = staying.entries(K, parameters), staying.entries(M, parameters), None
        n_u -= 1
    return _compile(K, M, K_g, case, parameters, motion, n_u)


def with_elements(case: CaseFile, elements: Mapping[str, int]) -> CaseFile:
    """The case with other numbers of elements for the named beam links."""
    return _with_links(case, lambda n, _: {"elements": elements[n]} if n in elements else {})


def with_reduction(case: CaseFile, frequencies: Mapping[str, float | None]) -> CaseFile:
    """The case with other frequencies (Hz) to which links are reduced; None leaves one whole."""
    return _with_links(case, lambda n, _: {"reduce_to": frequencies[n]} if n in frequencies else {})


def in_few_elements(case: CaseFile) -> CaseFile:
    """The case with one element for each beam whose section does not vary, beams and frames whole.

    Superelements and solids are left their interface.
    """

    def few(_: str, part: Any) -> dict[str, Any]:
        update: dict[str, Any] = {}
        if hasattr(part, "reduce_to"):
            update["reduce_to"] = LOWEST if part.type in IMPORTED else None
        if hasattr(part, "elements") and isinstance(part.section, str):
            update["elements"] = 1
        return update

    return _with_links(case, few)


def refined(case: CaseFile, factor: float) -> tuple[CaseFile, tuple[int, ...]]:
    """The case with ``factor`` times the elements in every beam, and their numbers.

    A beam keeps at least one. Every number of elements must be given or settled.
    """
    counts: list[int] = []

    def scaled(_: str, part: Any) -> dict[str, Any]:
        if not hasattr(part, "elements"):
            return {}
        counts.append(max(1, round(part.elements * factor)))
        return {"elements": counts[-1]}

    return _with_links(case, scaled), tuple(counts)


def _with_links(case: CaseFile, change: Callable[[str, Any], dict[str, Any]]) -> CaseFile:
    """The case with what ``change`` gives new for a link, or for a beam "link.beam" of one."""

    def changed(name: str, part: Any) -> Any:
        update = change(name, part)
        if hasattr(part, "beams"):
            update["beams"] = all_of(part.beams, f"{name}.")
        return part.model_copy(update=update)

    def all_of(parts: Any, prefix: str = "") -> Any:
        return type(parts)({n: changed(prefix + n, each) for n, each in parts.items()})

    links = all_of(case.mechanism.links)
    return replace(case, mechanism=case.mechanism.model_copy(update={"links": links}))


class WholeLinks(NamedTuple):
    """A case with its links before they are reduced, to any frequency."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    meshes: Mapping[str, LinkMesh]


def whole_links(case: CaseFile) -> WholeLinks:
    """Variables, kinematics and the mesh of every link with all its dofs."""
    numbers = variables(case)
    motion = erls_motion(case, numbers)
    return WholeLinks(case, numbers, motion, _meshes(case, numbers, motion))


def _meshes(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    given: Mapping[str, LinkMesh] | None = None,
) -> dict[str, LinkMesh]:
    """The mesh of every link, that ``given`` where there is one; copies of a beam share theirs."""
    known = parameters.with_passive(motion.passive)
    copies = copies_of(case, known, motion.tree)
    made: dict[object, LinkMesh] = {}
    found = dict(given or {})
    for name in (p.link for p in motion.placements if p.link not in found):
        key = copies.get(name, name)
        if key not in made:
            made[key] = _link_mesh(case, known, motion.tree, name)
        found[name] = made[key]
    return {p.link: found[p.link] for p in motion.placements}


def _link_mesh(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """The mesh of one link with all its dofs, its bodies included."""
    match link_type(case, name):
        case "rigid":
            return rigid_link(case, parameters, tree, name)
        case "frame":
            return frame_mesh(case, parameters, name)
        case "superelement":
            from eigassign.mechanism.elements.superelement import superelement_mesh

            return superelement_mesh(case, parameters, name)
        case "solid":
            from eigassign.mechanism.elements.superelement import solid_mesh

            return solid_mesh(case, parameters, name)
    return beam_mesh(case, parameters, tree, name)


def local_links(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    known: Mapping[str, LinkMesh] | None = None,
) -> LocalLinks:
    """Every link's matrices in its own frame, and how its nodes hang on the unknowns.

    Links are reduced as the case asks; ``known`` are the meshes of some or all, reduced or not.
    """
    meshes = {
        name: reduced_where_asked(case, parameters, name, mesh)
        for name, mesh in _meshes(case, parameters, motion, known).items()
    }
    nodes = NodeMotions(motion, meshes, case.mechanism.space)
    nodes.number()
    if motion.tree.n_elastic < len(motion.tree.loops):
        close_rigid_loops(nodes, parameters, reference(case, parameters))
    else:
        nodes.number_passive(motion.tree.passive)
    return [_local_link(p, meshes[p.link], nodes) for p in motion.placements], nodes


def by_name(motion: Kinematics, links: Sequence[LocalLink]) -> dict[str, LocalLink]:
    """The links by their names."""
    return {p.link: link for p, link in zip(motion.placements, links, strict=True)}


def rigid_links(case: CaseFile, parameters: ModelParameters, motion: Kinematics) -> list[LocalLink]:
    """Every link by itself in as few elements as may be: enough for its rigid motions."""
    meshes = _meshes(in_few_elements(case), parameters, motion)
    found = []
    for p in motion.placements:  # none of its nodes joined to others
        mesh = meshes[p.link]
        twist, own = p.twist[: mesh.rigid[0].matrix.shape[1]], np.arange(mesh.n_local)
        found.append(LocalLink(mesh.stiffness, mesh.mass, mesh.rigid, twist, own, {}))
    return found


def _local_link(placement: Placement, mesh: LinkMesh, nodes: NodeMotions) -> LocalLink:
    """The link's matrices with its own unknowns and the motion of its carried nodes."""
    own = nodes.own[placement.link]
    carried = {}
    for name, slots in mesh.nodes.items():
        present = slots[slots >= 0]
        if (own[present] < 0).any():
            rows = nodes.rows((placement.link, name))
            for component, slot in enumerate(slots):
                if slot >= 0:
                    carried[int(slot)] = list(rows[component].items())
    return LocalLink(
        stiffness=mesh.stiffness,
        mass=mesh.mass,
        rigid=mesh.rigid,
        twist=placement.twist[list(DOFS[nodes.space])],
        own=own,
        carried=carried,
        reduction=mesh.reduction,
    )


def loss_pencil(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    meshes: Mapping[str, LinkMesh],
    factor: Callable[[Any], float],
) -> Pencil:
    """K_loss = Σ η_c K_c as the K of a pencil in the same unknowns, of links as they are meshed.

    K is linear in the stiffness K_c of each material and drive, whose η_c ``factor`` tells. Raises
    MechanismError for a reduced frame with several.
    """
    mechanism, numbers = case.mechanism, dict(parameters.by_path)

    def lose(path: str, part: Any, key: str, eta: float) -> None:
        given = getattr(part, key, None)
        if given is not None:
            numbers[f"{path}.{key}"] = parameters.number(f"{path}.{key}", given) * eta

    for name, own in case.coordinates.items():
        lose(f"coordinates.{name}.drive", own.drive, "stiffness", factor(own.drive))
    for name, material in mechanism.materials.items():
        for key in ("youngs_modulus", "shear_modulus"):
            lose(f"materials.{name}", material, key, max(factor(material), SMALLEST))
    given = replace(parameters, by_path=numbers)
    lossy = {}
    for name, mesh in _meshes(case, parameters, motion, meshes).items():
        link: Any = mechanism.links[name]
        parts = link.beams.values() if hasattr(link, "beams") else [link]
        names = {part.material for part in parts if hasattr(part, "material")}
        each = {factor(mechanism.materials[material]) for material in names} or {0.0}
        if len(each) == 1:
            (eta,) = each
            terms = [Term(term.coefficient * eta, term.matrix) for term in mesh.stiffness]
            lossy[name] = mesh._replace(stiffness=terms)
        elif mesh.reduction:
            message = "its materials have several loss factors: leave reduce_to out"
            raise MechanismError(f"mechanism.links.{name}.reduce_to", message)
        else:
            lossy[name] = _link_mesh(case, given, motion.tree, name)
    links, nodes = local_links(case, given, motion, lossy)
    stiffness, mass = AffineEntries(), AffineEntries()
    add_links(stiffness, mass, links, nodes.count)
    add_drives(stiffness, mass, case, given, motion, nodes.count)
    entries = stiffness.finish(nodes.count), mass.finish(nodes.count)
    return _compile(*entries, None, case, given, motion, nodes.count)


def add_drives(
    stiffness: AffineEntries,
    mass: AffineEntries,
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    n_u: int,
) -> None:
    """½ k ṡ² of a held joint and ½ J ṡ² of any driven one, with its rate ṡ = r q̇."""
    for i, (name, coordinate) in enumerate(case.coordinates.items()):
        if isinstance(coordinate.drive, str):
            continue
        r = motion.coordinates.rates[i]
        for target, key in ((stiffness, "stiffness"), (mass, "inertia")):
            value = drive_value(case, parameters, name, key)
            if value is None:
                continue
            for row, column in zip(*np.nonzero(np.outer(r, r)), strict=True):
                target.add(n_u + row, n_u + column, value * (r[row] * r[column]))


def drive_value(case: CaseFile, parameters: ModelParameters, name: str, key: str) -> Scalar | None:
    """Stiffness or inertia of a coordinate's drive, None where it has none.

    The inertia of a motor's rotor J_m is J_m N² on the joint, with the gear's ratio N.
    """
    drive: Any = case.coordinates[name].drive
    path = f"coordinates.{name}.drive"
    if key == "inertia" and getattr(drive, "motor_inertia", None) is not None:
        ratio = parameters.number(f"{path}.ratio", drive.ratio or 1.0)
        return parameters.number(f"{path}.motor_inertia", drive.motor_inertia) * ratio**2.0
    given = getattr(drive, key, None)
    return None if given is None else parameters.number(f"{path}.{key}", given)


def _compile(
    stiffness: Entries,
    mass: Entries,
    weight: Entries | None,
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    n_u: int,
) -> Pencil:
    n_dof = n_u + len(motion.columns)
    if not n_dof:
        raise MechanismError("mechanism.links", "nothing can move: every link is rigid and locked")
    entries = [stiffness, mass] if weight is None else [stiffness, mass, weight]
    rows, columns, weights, program = compiled_pattern(entries, parameters, n_dof)
    return Pencil(
        n_dof=n_dof,
        n_u=n_u,
        rigid=n_u + np.array(motion.rigid, dtype=np.intp),
        rows=rows,
        columns=columns,
        stiffness=weights[0] + weights[2] if weight is not None else weights[0],
        mass=weights[1],
        program=program,
        to_program=parameters.to_z,
        shift=parameters.shift,
        n_q=len(parameters.coordinates) + len(parameters.loads),
        n_loads=len(parameters.loads),
        limits=property_limits(case),
        rails=rails(case, parameters.with_passive(motion.passive), motion.tree),
        weight=(
            _weight((rows, columns), weights, case, parameters, motion, n_u) if weight else None
        ),
    )


def compiled_pattern(
    entries: Sequence[Entries], parameters: ModelParameters, n_dof: int
) -> tuple[Ints, Ints, list[sparse.csr_array], Program]:
    """The common pattern of several matrices, their weights on it, and θ's program."""
    used = np.zeros(1 + len(parameters.recorder.nodes), dtype=bool)  # the constant, every atom
    used[0] = True
    for entry in entries:
        used[entry[2] + 1] = True
    place, atoms = np.cumsum(used) - 1, np.flatnonzero(used)[1:] - 1
    theta = [(r, c, place[a + 1], v) for r, c, a, v in entries]
    program = compile_program(parameters.recorder, atoms.tolist(), parameters.count)
    return *pattern(theta, n_dof, len(atoms) + 1), program


def _weight(
    places: tuple[Ints, Ints],
    weights: Sequence[sparse.csr_array],
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    n_u: int,
) -> Weight | None:
    """K_g beside K and M with these ``weights`` at their ``places``; None without gravity."""
    g = gravity(case)
    if g is None:
        return None
    K, _, K_g = weights
    held = places[0][np.diff(K.indptr) > 0]
    columns = [k for k in range(len(motion.columns)) if k not in motion.rigid]
    joints, names = n_u + np.array(columns, dtype=np.intp), tuple(case.coordinates)
    entries = np.flatnonzero(np.isin(places, joints).all(axis=0))
    i, j = (np.searchsorted(joints, each[entries]) for each in places)
    at = np.ones(len(entries)), (i * len(joints) + j, np.arange(len(entries)))
    spread = sparse.csr_array(at, shape=(len(joints) ** 2, len(entries)))
    return Weight(
        stiffness=K_g,
        without=K,
        joints=joints,
        among_joints=sparse.csr_array(spread @ K_g[entries]),
        swinging=np.flatnonzero(~np.isin(joints, held)),
        names=tuple(names[motion.columns[k]] for k in columns),
        variables=(*parameters.coordinates, *parameters.loads, *parameters.design),
        units=(*case.q_units, *case.design_units),
        gravity=float(np.linalg.norm(g)),
    )
