"""Frequencies of the affine pencil: exact, by Taylor expansion, and reduced.

In reading order:

    arguments       samples of (q, y), modes and orders as callers give them, checked
    exact           exact elastic modes
    taylor          Taylor coefficients of eigenvalues and eigenvectors (eqs. (4)-(6))
    reduced         Ritz on the Taylor vectors
    expansion       the Taylor polynomial of eigenvalues (eqs. (7)-(9)), and as plain arrays
    mesh_error      what meshes of beams and solids leave out
    model           the model of a case, as notebooks meet it
    antiresonances  frequencies at which a force leaves its node at rest
    under_load      what the weight does to frequencies, and what gives way under forces
    response        frequency responses by modes, and their slopes
    residual_vibration  what a move leaves of the tip's error
    slow_motion     how much the neglected motion would move the frequencies
    adaptive_order  order and expansion points of the Taylor polynomial, judged by exact solves
    shapers         commands of delayed copies that leave modes without vibration
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "antiresonances": "Antiresonances",
        "adaptive_order": "MARGIN raise_order",
        "exact.inertia": "count_below",
        "exact.solver": "clusters eigenvalues exact_slopes lowest_modes modes rounding_error",
        "exact.large": "solve_large",
        "exact.tracking": "FollowedShape ModesAtPoint MoreModesError follow places",
        "expansion": "Expansion NearestExpansion expand expansion_arrays tree_arrays",
        "model": "Model",
        "taylor.rayleigh": "project project_at project_terms",
        "reduced": "ReducedModel reduce",
        "response": "Damping ModalResponse Shaken dampings modal_response unit_forces",
        "shapers": (
            "SHAPERS Design ModeOnPath Shaper best_design best_designs convolved "
            "excited_modes klipper_lines reprap_line residual_share shaped shaped_along "
            "shaper worst_share"
        ),
        "residual_vibration": "FINER Move ReducedMove Sizes move",
        "slow_motion": "change_at motion_effect moving_modes theta_in_time",
        "under_load": (
            "Flexibility WeightChanges buckling compliances sag_changes sag_of_nodes "
            "sags strut_error weight_changes"
        ),
        "taylor.bordered": "factor_dense factor_sparse",
        "taylor.recursion": "expand_subspace",
    },
)
