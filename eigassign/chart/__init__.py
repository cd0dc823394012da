"""Time against accuracy of every way to the frequencies of a case, timed on this machine.

Reading order:

    results     what is asked of a chart and what it holds, as plain numbers
    timing      how much a chart tries, how jobs are timed, and the machine
    question    the points at which every method is asked for frequencies
    surrogates  interpolation and regression on the unit box
    methods     the list of methods
    advice      which methods no other beats, and what to choose
    comparison  every method put the same question: built, evaluated, timed, compared
    mesh        elements per link against discretisation error
    designs     ways to a design against the objective that each reaches
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "comparison": "compare_methods skipped_notes",
        "designs": "chart_designs",
        "advice": "advise front pareto",
        "mesh": "chart_meshes refined",
        "question": "build_features build_question",
        "results": (
            "Advice Asked AutoTakes Chart ChartPoint DesignRun Errors Front MeshRow Request Timing "
            "excess_over"
        ),
        "surrogates": "grid_interpolation nodes spread_points surrogate_families",
        "timing": "QUICK Effort machine measure time_in_words",
    },
)
