"""Batches whose cases take no time: an executor that makes a folder for each and says it is ok."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path

from eigassign.batch import Batch, CaseOptions, Variant, Workers, outcome_of, plan_of, run
from eigassign.output import CaseOutcome, run_folder, to_plain

TEXT = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
MASS = "mechanism.bodies.tool_mass.mass"


def case(folder: Path, name: str = "arm.yaml", end: str = "") -> Path:
    """A case file."""
    file = folder / name
    file.write_text(TEXT + end)
    return file


def batch_of(
    folder: Path,
    masses: str = "0..1:5",
    force: bool = False,
    file: str = "arm.yaml",
    setting: str = "",
) -> Batch:
    """A sweep over the mass, or of what ``setting`` says, of a case that is there already."""
    plan = plan_of([folder / file], [setting or f"{MASS}={masses}"])
    return Batch(plan, folder / "out", CaseOptions(str(folder / "out"), force=force))


def write_run(folder: Path, outcome: CaseOutcome) -> None:
    """The folder of a case that ended so, as a worker leaves it."""
    row = to_plain(outcome)
    left = {"case_path": Path(outcome.path), "key": outcome.key, "outcome": row}
    with run_folder(folder, **left, force=True) as hidden:  # type: ignore[arg-type]
        (hidden / "case.yaml").write_text(f"title: {outcome.name}\n")
        if outcome.run_folder:
            (hidden / "results.json").write_text(f'{{"case": "{outcome.name}"}}\n')


class Instant(Executor):
    """Runs nothing; ``heard`` gets the name of each case that would have run."""

    def __init__(self, out: Path, heard: Callable[[str], None]) -> None:
        self.out, self.heard = out, heard

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        future: Future[object] = Future()
        future.set_result(self.ended(args[0]))
        return future

    def ended(self, variant: Variant):  # type: ignore[no-untyped-def]
        """How the case ends: well; in an error where its mass is 0.25; without answer at 0.75."""
        self.heard(variant.name)
        if variant.values.get(MASS) == 0.25:
            return outcome_of(variant, "error", message="not this one")
        if variant.values.get(MASS) == 0.75:
            outcome = outcome_of(variant, "failed", message="no design meets it")
        else:
            outcome = outcome_of(variant, "ok", run_folder=variant.name)
        write_run(self.out / variant.name, outcome)
        return outcome


def instant(out: Path, heard: Callable[[str], None], slots: int = 2) -> Workers:
    """The place where such batches run."""

    @contextmanager
    def opened(_slots: int) -> Iterator[Executor]:
        yield Instant(out, heard)

    return Workers(slots, opened)


def ran(batch: Batch, place: Workers | None = None) -> list[str]:
    """Run it; the names of the cases that were not done before."""
    heard: list[str] = []
    place = place or instant(batch.folder, lambda _name: None)
    run(batch, place, lambda _total, _done: None, lambda found: heard.append(found.name))
    return heard


def names(batch: Batch, indices: Sequence[int]) -> list[str]:
    """Of cases of a batch."""
    return [batch.plan[index].name for index in indices]
