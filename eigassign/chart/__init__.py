"""Time against accuracy of every way to the frequencies of a case, timed on this machine.

Reading order:

    results     what is asked of a chart and what it holds, as plain numbers, and words for these
    question    the points at which every method is asked for frequencies; how answers are timed
    methods     the list of methods
    comparison  every method put the same question; meshes; which no other beats, what to choose
    designs     ways to a design against the objective that each reaches
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "comparison": "advise chart_meshes compare_methods front skipped_notes",
        "designs": "chart_designs",
        "question": "QUICK Effort build_bench build_question measure",
        "results": (
            "Advice Asked AutoTakes Chart ChartPoint DesignRun Errors Front MeshRow Request Timing "
            "excess_over machine time_in_words"
        ),
    },
)
