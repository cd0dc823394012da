"""One case: choices left to auto, optimal design, comparison with exact frequencies.

Reading order:

    build       from a case file in which every number is given to its model and trajectories
    results     what a run found, as plain numbers and names: all that the output is given to show
    planning    expansion point, order and modes; what is left to auto, and where it is judged
    built_case  a validated case with what is built from it, all left to auto for its links settled
    scene       model, trajectory and expansions of a case in one object
    checks      what is measured of an answer: mesh, links, expansions, whether the motion is slow
    comparison  how good expansions are, against exact solves
    design      from the targets to the answer, and the verdict
    meaning     what the answer means, as far as the user asks for it
    pictures    what is drawn of a mechanism, as plain lines and numbers
    updating    parameters from measured frequencies
    given       the inputs of a case in three lines
    collect     all of it put together as the results of a run
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "checks.slow_motion": "gap_along",
        "build": "build_model",
        "built_case": "BuiltCase load_case settle_model",
        "comparison": (
            "BETWEEN DESIGN_BOX TRAJECTORY compare "
            "reach_warnings study_expansions study_modes unseen_points "
            "validate_expansions"
        ),
        "design.answer": "Answer find_answer",
        "design.clearance": "check_band",
        "design.followed": "followers named_design named_pose require_one_shape solve_design",
        "design.judgement": "crossing_warnings",
        "design.search.optimum": "Found find_optimum",
        "design.search.response": ("DesignResponse ReducedModels reduced_models response_of"),
        "design.search.variants": "Task variant_of",
        "design.verdict": "Facts Verdict verdict",
        "pictures.drawing": "AMPLITUDE draw_modes draw_poses rest_pose",
        "meaning.overall": "Studies study_meaning",
        "meaning.reach": "proved_ranges unreachable",
        "planning": (
            "Plan at_corners automatic_elements central_sample corners joint_map "
            "farthest plan_expansion scattered "
            "unseen with_middle_loads"
        ),
        "results": (
            "AimRow AssignmentRow CaseRow CatalogueRow ClearanceRow CombinationRow "
            "Comparison DesignRow DrawnBody DrawnJoint DrawnPoses DrawnSpring ErrorRow "
            "ErrorSummary LimitRow LocalOptimum Meaning ModePictures ModeStudy OptimalityRow "
            "ModeRow RangeRow RunResults SensitivityRow SolverRow TargetAlong "
            "TargetStudy TrajectoryRow ValidationRow"
        ),
        "scene": "Scene",
        "updating.fit": "UpdateResults solve_update update_problem",
        "updating.measured": "read_measurements",
    },
)
