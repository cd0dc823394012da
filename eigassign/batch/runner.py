"""A batch: every case of a plan once, whoever is killed meanwhile.

    plan → check the variants → what the folder does not hold yet → tasks → a line of the manifest
    for each result as it comes in → summaries

`cases` says what a case goes through.

Where tasks run is `workers.Workers`; they are `work.run_cases` of one or several variants. Workers
write the folders of their cases, this process writes all else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from typing import NoReturn

from eigassign.batch.cases import Batch, Progress, alone_in, summarise, take_up
from eigassign.batch.manifest import InOrder, read_header
from eigassign.batch.plan import Variant, variant_problem
from eigassign.batch.work import check_cases, outcome_of, run_cases
from eigassign.batch.workers import Workers, run_all, this_machine
from eigassign.errors import CaseError, Problem, StorageError
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.store.run_record import MARKER
from eigassign.pipeline.stages import Stages, silent

_CHECKED = 100  # variants in a task that checks them: half a second
_SHOWN = 10  # problems of variants


def run(
    batch: Batch,
    workers: Workers,
    on_start: Callable[[Progress], None],
    on_outcome: Callable[[CaseOutcome], None],
    say: Callable[[str], None] = silent,
) -> InOrder:
    """Run what is not done yet, and write the summaries; the rows of all cases.

    ``on_start`` hears what is done already, ``on_outcome`` of each case that is run. After an
    interrupt the summaries have what there is. Raises CaseError, before anything is written, where
    a variant is no valid case, and StorageError where the folder is of another batch, or another
    one is at work in it.
    """
    folder = batch.folder
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"{folder} is a file: choose a folder with --out")
    if (folder / MARKER).exists():
        raise StorageError(f"{folder} is the folder of a run: choose another one with --out")
    require_valid(batch, workers, say)
    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder):
        take_up(batch)
        progress = Progress(batch)
        on_start(progress)
        try:
            _run(batch, progress, workers, on_outcome)
        finally:
            progress.sync()
            rows = summarise(folder, batch.header)
    return rows


def require_valid(batch: Batch, workers: Workers, say: Callable[[str], None] = silent) -> None:
    """Check every variant of a sweep, once for each folder; raises CaseError."""
    if not batch.plan.is_swept or read_header(batch.folder) == batch.header:
        return
    plan, stages = batch.plan, Stages(say)
    spans = plan.swept()
    parts = (span[k : k + _CHECKED] for span in spans for k in range(0, len(span), _CHECKED))
    total, done, wrong, first = sum(map(len, spans)), 0, 0, list[tuple[int, Problem]]()
    if not total:
        return

    def keep(task: Sequence[Variant], found: Sequence[tuple[int, tuple[Problem, ...]]]) -> None:
        nonlocal done, wrong
        done, wrong = done + len(task), wrong + len(found)
        stages.advance(done, total)
        first.extend((index, problem) for index, problems in found for problem in problems)
        first[:] = sorted(first, key=itemgetter(0))[:_SHOWN]

    check, where = partial(check_cases, options=batch.options), this_machine(1)
    with stages("check", f"checking {total} variant{'s' if total > 1 else ''}"):
        tasks = ([plan[k] for k in part] for part in parts)
        run_all(workers if total > _CHECKED else where, tasks, check, keep, _lost_in_check)
    if wrong:
        problems = [variant_problem(plan, *each) for each in first]
        many = f"{wrong} of {total} variants are not valid: nothing was run"
        raise CaseError((*problems, Problem(plan.files[0].path, 0, 0, "", many)))


def _lost_in_check(variant: Variant) -> NoReturn:
    what = "the process that checked it was killed, perhaps because memory ran out"
    raise StorageError(f"{variant.path}: {variant.name}: {what}")


def _run(
    batch: Batch, progress: Progress, workers: Workers, on_outcome: Callable[[CaseOutcome], None]
) -> None:
    """Run all cases that are not done."""
    cases, seconds = 0, 0.0

    def keep(_task: Sequence[Variant], found: Sequence[CaseOutcome]) -> None:
        nonlocal cases, seconds
        for outcome in found:
            progress.keep(outcome)
            cases, seconds = cases + 1, seconds + outcome.seconds
            on_outcome(outcome)

    def size() -> int:
        """Cases of a task: one until a case is done."""
        return int(max(1.0, workers.task_s * cases / max(seconds, 1e-9)))

    def lose(variant: Variant) -> None:
        why = "memory or time" if batch.options.seconds else "memory"
        message = f"the process that ran it was killed, perhaps because {why} ran out"
        keep([variant], [outcome_of(variant, "error", message=message)])

    work = partial(run_cases, options=batch.options)
    run_all(workers, progress.tasks(size), work, keep, lose)
