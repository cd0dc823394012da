"""The table of rules: what several keys must have in common, once the form of each is right.

A rule keeps silent about what it cannot judge since a name in it stands for nothing: that is told
already. Its name and docstring say what must hold; it yields where it does not, and why. To add
one: write it, and name it here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from eigassign.case.reader import Finding, KeyPath, Tree, items
from eigassign.case.rules import mechanism, properties, study, values
from eigassign.case.schema.document import Document
from eigassign.case.schema.mechanism import Mechanism

Rule = Callable[[Document], Iterator[Finding]]


def reserved_names_are_not_used(document: Document) -> Iterator[Finding]:
    """`ground` is no link, `time` heads every table over time, `torque` limits drives."""
    if "time" in document.coordinates:
        yield ("coordinates", "time"), "'time' heads a column of its own: name it otherwise"
    if "ground" in document.mechanism.links:
        path = ("mechanism", "links", "ground")
        yield path, "'ground' is the fixed frame: name the link otherwise"
    if "torque" in document.design.entries:
        message = "'torque' limits what drives exert, by coordinate: name the parameter otherwise"
        yield ("design", "torque"), message


RULES: tuple[Rule, ...] = (
    reserved_names_are_not_used,
    mechanism.links_have_known_materials,
    mechanism.beams_have_known_sections,
    mechanism.bare_sections_have_the_moments_of_their_space,
    mechanism.rigid_links_have_one_end,
    mechanism.frames_hang_together,
    mechanism.beams_have_no_more_elements_than_can_be_meant,
    mechanism.superelements_have_rows_of_their_own_for_each_node,
    mechanism.links_that_a_joint_travels_along_are_not_reduced,
    mechanism.bodies_and_tips_are_on_nodes,
    mechanism.springs_join_two_nodes,
    mechanism.joints_connect_two_links,
    mechanism.beams_carry_one_rider,
    mechanism.nuts_are_on_their_shaft,
    mechanism.links_are_connected_to_the_ground,
    mechanism.coordinates_move_one_freedom_each,
    mechanism.assembly_names_coordinates_and_joints,
    mechanism.assembly_is_for_loops,
    properties.parameters_name_properties,
    properties.properties_of_one_parameter_are_alike,
    properties.load_cases_set_properties,
    values.values_are_what_they_are_of,
    study.lists_have_an_entry_for_each_coordinate,
    study.expansion_point_has_an_entry_for_each_parameter,
    study.trajectories_have_names_of_their_own,
    study.branches_are_ranges_of_driven_joints,
    study.parameters_vary_different_properties,
    study.limited_drives_are_of_coordinates,
    study.constraints_are_between_design_parameters,
    study.targets_are_on_trajectories,
    study.statics_are_of_nodes,
    study.a_mode_has_one_frequency_at_a_time,
    study.followed_modes_are_at_a_pose,
    study.measurements_are_at_poses,
    study.one_shot_has_a_quadratic_program,
    study.objectives_have_what_they_take,
    study.robust_designs_have_tolerances,
    study.profiles_cover_their_trajectories,
)
LAST: tuple[Rule, ...] = (  # of cases in which every name and unit is right
    study.bounds_go_upwards,
    properties.parameters_agree_with_the_file,
    properties.bounds_hold_nothing_impossible,
    properties.load_cases_set_nothing_impossible,
)


def inconsistent(document: Document) -> Iterator[Finding]:
    """Everything that does not fit together."""
    found = False
    for rule in RULES:
        for finding in rule(document):
            found = True
            yield finding
    for rule in () if found else LAST:
        yield from rule(document)


# --- Before the form is looked at


def keys_have_values(node: object, path: KeyPath = ()) -> Iterator[Finding]:
    """No key and no entry of a list below ``path`` is left empty."""
    if node is None:
        comma = bool(path) and str(path[-1])[:1].isdigit()
        hint = " (decimals take a point, not a comma)" if comma else ""
        yield path, f"has no value: give one, or leave the key out{hint}"
    for key, inner in node.items() if isinstance(node, Mapping) else ():
        yield from keys_have_values(inner, (*path, key))
    for k, inner in enumerate(node) if isinstance(node, tuple) else ():
        if not isinstance(inner, (int, float)):
            yield from keys_have_values(inner, (*path, k))


_MOST = 1000  # entries of a group
_MOST_INSIDE = 10_000  # nodes or beams of one link
_GROUPS = (
    *(("mechanism", group) for group in Mechanism.model_fields),
    ("coordinates",),
    ("design",),
    ("design", "constraints"),
)


def too_many(tree: Tree) -> Iterator[Finding]:
    """Groups so large that looking for further problems could take minutes."""
    for place in _GROUPS:
        if len(items(tree, *place)) > _MOST:
            yield place, f"more than {_MOST} entries"
    for name, _ in items(tree, "mechanism", "links"):
        for key in ("nodes", "beams"):
            place = ("mechanism", "links", name, key)
            if len(items(tree, *place)) > _MOST_INSIDE:
                yield place, f"more than {_MOST_INSIDE} entries: make it a superelement"
