"""One case from its file to its folder: the stages in order, and what they read and write.

Reading order:

    stages   the stages of a run, its folder and log; expansions from the cache or computed
    queries  check a case, draw it; its frequencies at one point
    run      the paper's flowchart: case, model, expansion, assignment, verification; responses
    urdf     a robot from URDF as the content of a case
    studies  measured frequencies to the parameters that explain them
    charting  speed against accuracy of every method, on one case or several
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "charting": "chart_case chart_cases",
        "queries": "check draw modes",
        "run": (
            "Options Outcome Result expand_case optimize prepare respond responding solve_case "
            "validate"
        ),
        "stages": "Stages affordable_order expand_plan expansion_key silent",
        "studies": "update_case",
    },
)
