"""Speed against accuracy of every method on a case, where methods fail, and what to write.

Reading order:

    results     what a chart holds, as plain numbers, and what it tells; several side by side
    question    points to learn from, and others as a test
    methods     the list of methods
    comparison  every method put the same question, in boxes too; what fails, by name
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "comparison": "HALF_WIDTHS compare_methods find_failures front reaches study_boxes",
        "methods": "Built Method list_methods",
        "question": "QUICK Effort Points Subject build_subject errors",
        "results": (
            "ACCURACY EVALUATIONS Advice BoxRow Cell Chart ChartPoint Finding Front Kind Matrix "
            "Reach advised build_matrix machine"
        ),
    },
)
