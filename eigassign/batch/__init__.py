"""Many cases, none computed twice, whoever is killed meanwhile.

Reading order:

    variants  the variants of a case: its `sweep`, or what --set says
    plan      which cases, in which order; the name and the key of each
    manifest  the index of a folder: which plan it is of, and how each case ended
    limits    the time of a case
    work      what a worker does: check a variant, run it
    cases     the life of a case: its record, taking up a folder, giving cases out, summaries
    workers   where tasks run: this process, or processes that are gone when the parent is
    cluster   the workers of a dask.distributed scheduler
    runner    all of it together: start there
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "limits": "OutOfTimeError limited",
        "cases": "Batch summarise",
        "manifest": "Header InOrder Manifest read_header write_header",
        "plan": "Variant cases_in folder_names plan_of variant_problem",
        "runner": "run",
        "variants": "Variants variants_of",
        "work": "CaseOptions outcome_of run_cases",
        "workers": "Workers process_pool this_machine",
    },
)
