"""One case: choices left to auto, optimal design, comparison with exact frequencies.

Reading order:

    results     what a run found, as plain numbers and names: all that the output is given to show
    planning    expansion point, order and modes; what is left to auto, and where it is judged
    built_case  validated cases, models and trajectories; what is left to auto for links, settled
    scene       model, trajectory and expansions of a case in one object, against exact solves
    checks      what is measured of an answer: mesh, links, expansions, whether the motion is slow
    response    responses along the trajectory, and speeds that are free
    moves       what a move leaves, by time and by motion time; input shapers
    design      from the targets to the answer, and the verdict
    meaning     what the answer means, as far as the user asks for it
    given       the inputs of a case in three lines
    pictures    what is drawn of a mechanism, as plain lines and numbers
    updating    parameters from measured frequencies
    collect     all of it put together as the results of a run
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "checks": "gap_along",
        "built_case": "BuiltCase build_model load_case settle_model",
        "design.answer": "Answer find_answer",
        "design.clearance": "check_band",
        "design.followed": "followers named_pose solve_design",
        "design.judgement": "Facts Verdict verdict",
        "design.search.optimum": "Found find_optimum",
        "design.search.response": "DesignResponse response_of",
        "design.search.variants": "Task variant_of",
        "pictures": "AMPLITUDE draw_modes draw_poses rest_pose",
        "meaning": "Studies levers proved_ranges study_meaning unreachable",
        "planning": (
            "Plan at_corners automatic_elements central_sample corners joint_map "
            "farthest plan_expansion scattered "
            "unseen with_middle_loads"
        ),
        "results": (
            "AimRow AssignmentRow CaseRow CatalogueRow ClearanceRow CombinationRow "
            "Comparison DesignRow DrawnBody DrawnJoint DrawnPoses DrawnSpring ErrorRow "
            "ErrorSummary LimitRow LocalOptimum Meaning ModePictures ModeStudy OptimalityRow "
            "ModeRow RangeRow ResponseRow RunResults SensitivityRow SolverRow TargetAlong "
            "TargetStudy TrajectoryRow ValidationRow"
        ),
        "response": "study_responses",
        "scene": (
            "BETWEEN DESIGN_BOX Scene TRAJECTORY compare reach_warnings "
            "study_modes unseen_points validate_expansions"
        ),
        "updating.fit": "UpdateResults solve_update update_problem",
        "updating.measured": "read_measurements",
    },
)
