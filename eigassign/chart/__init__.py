"""Time against accuracy of every way to the frequencies of a case, timed on this machine.

Reading order:

    results     what is asked of a chart and what it holds, as plain numbers, and words for these
    question    the points at which every method is asked for frequencies; how answers are timed
    methods     the list of methods
    comparison  every method put the same question; meshes; which no other beats, what to choose
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "comparison": "advise chart_meshes compare_methods front skipped_notes",
        "question": "QUICK Effort build_bench build_question measure",
        "results": (
            "ACCURACIES Advice Asked Chart ChartPoint Errors Front MeshRow Timing machine "
            "time_in_words"
        ),
    },
)
