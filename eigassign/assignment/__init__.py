"""From linear models of λ to the optimal design: eqs. (13)–(14) built, solved and judged.

Reading order:

    inputs        targets and weights in time, λ in Hz, what is linear in the design
    requirements  what a case asks for: one type from the case file to the report
    program       build: the program of eqs. (13)–(14), in its units; limits that contradict
    solver        solve: OSQP, then an active-set method that goes to round-off
    exact         the optimum of the exact problem, and parameters from measurements
    assign        build, solve, judge: from targets to the optimal design
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "assign": "ActiveLimit Assignment Certificate best_candidate judge solve_assignment",
        "exact.design_problem": "Appraisal Cost DesignProblem Objective best_first",
        "exact.identification": "Identified MeasuredFrequencies identify",
        "exact.requirements": "Requirements Tolerances with_scenarios",
        "exact.sequential": "End Optimum StepRecord Tally minimise with_end",
        "exact.design_point": "first_order",
        "program": "Bounds ProgramAnswer build_program scaled_program unscaled",
        "requirements.kinds": (
            "AssignedFrequency ForbiddenBand HighestFrequency LowerLimit ModeGap UpperLimit"
        ),
        "requirements.quantity": "MassLimit",
        "requirements.requirement": "Frequencies Requirement Solved",
        "requirements.sampling": "KINDS design_limits followed_modes requirements_of time_weights",
        "solver": "Status solve_program solve_scaled",
        "inputs": (
            "LinearConstraint LinearModel hz_from_lam lam_from_hz sample_target trapezoidal_weights"
        ),
    },
)
