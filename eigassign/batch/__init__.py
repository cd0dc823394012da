"""Many cases, none computed twice, whoever is killed meanwhile.

Reading order:

    variants  the variants of a case: its `sweep`, or what --set says
    plan      which cases, in which order; the name and the key of each
    work      what a worker does: check a variant, run it
    workers   where tasks run: in this process, or in processes beside it
    runner    all of it together, and what of a batch is done: start there
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "plan": "Variant cases_in folder_names plan_of variant_problem",
        "runner": "Batch run",
        "variants": "Variants variants_of",
        "work": "CaseOptions outcome_of run_case",
        "workers": "Workers process_pool this_machine",
    },
)
