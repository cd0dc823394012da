"""From linear models of λ to the optimal design: eqs. (13)–(14) built, solved and judged.

Reading order:

    program       programs with linear limits by OSQP and active sets; limits that contradict
    requirements  what a case asks for: one type from the case file to the report
    one_shot      the program of eqs. (13)–(14), in its units, its optimum and residuals
    exact         the optimum of the exact problem, and parameters from measurements
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "exact.design_problem": "Appraisal Cost DesignProblem Objective best_first",
        "exact.identification": "Identified MeasuredFrequencies identify",
        "exact.ranges": "Explained explain",
        "exact.requirements": "Ellipsoid Requirements Tolerances with_scenarios",
        "exact.sequential": "End Optimum StepRecord Tally minimise with_end",
        "exact.design_point": "first_order",
        "one_shot": (
            "ActiveLimit Assignment LinearModel hz_from_lam judge lam_from_hz relative_rows "
            "solve_assignment"
        ),
        "program": "LinearConstraint Program solve_program",
        "requirements.kinds": (
            "AssignedFrequency ForbiddenBand HighestFrequency KINDS LowerLimit ModeGap UpperLimit"
        ),
        "requirements.quantity": "limit_between",
        "requirements.requirement": "Frequencies Requirement Solved",
        "requirements.sampling": (
            "design_limits followed_modes requirements_of time_weights trapezoidal_weights"
        ),
    },
)
