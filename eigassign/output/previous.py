"""What an earlier result said of the same cases, and what has moved since.

Frequencies are compared, each by its lowest, mean and highest value in Hz somewhere: of answers
along the trajectory, of validations at all the places they look at. An earlier result is a file,
results.json, summary.json or what ``validate --json`` printed, or a folder that has one or several.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from eigassign.case.schema.targets import TARGETS, HighestTarget
from eigassign.errors import UsageError
from eigassign.facts import Fact
from eigassign.files import TABLE, json_value, read_bytes
from eigassign.output.batch.summary import CaseOutcome, Range, from_plain, ranges
from eigassign.output.tables import Table, facts_table
from eigassign.study.comparison import TRAJECTORY
from eigassign.study.results import ValidationRow

Kind = Literal["answers", "validations"]
_STATISTICS = ("lowest", "mean", "highest")


@dataclass(frozen=True)
class Known:
    """One case of a result: frequencies in Hz by what they are of, and how it ended."""

    case: str
    frequencies: tuple[Range, ...] = ()
    ended: str = ""

    @classmethod
    def of_outcome(cls, row: CaseOutcome) -> Known:
        """The answer of a case, from its row in a batch."""
        return cls(row.name, tuple(row.frequencies), row.verdict or row.status)

    @classmethod
    def of_validation(cls, case: str, rows: Iterable[ValidationRow]) -> Known:
        """Exact frequencies of a case where a validation looked."""
        found = [(_place(r.mode, r.where), r.lowest_hz, r.mean_hz, r.highest_hz) for r in rows]
        return cls(case, tuple(found))


@dataclass(frozen=True)
class Moved:
    """A difference to before: how a case ended, or a frequency, which moved by ``hz``."""

    case: str
    what: str
    before: str
    now: str
    hz: Annotated[float | None, Fact(heading="moved by", digits=lambda hz: f"{hz:+.4g} Hz")] = None

    def __str__(self) -> str:
        by = "" if self.hz is None else f", moved by {self.hz:+.4g} Hz"
        return f"{self.what}: was {self.before}, is {self.now}{by}"


class EarlierResult:
    """An earlier result, cases compared with it one by one, and what has moved so far."""

    def __init__(self, path: Path, kind: Kind, tolerance_hz: float) -> None:
        """Raises UsageError where ``path`` has nothing of this kind."""
        self._path, self._tolerance = path, tolerance_hz
        self._before = {known.case: known for known in _read(path, kind)}
        self._compared = self._new = 0
        self._seen: set[str] = set()
        self.moves: list[Moved] = []

    def add(self, now: Known) -> list[Moved]:
        """Compare a case; the differences."""
        self._seen.add(now.case)
        before = self._before.get(now.case, Known(now.case))
        known = {name: hz for name, *hz in before.frequencies}
        moves = []
        if before.ended and now.ended and before.ended != now.ended:
            moves.append(Moved(now.case, "verdict", before.ended, now.ended))
        for name, *hz in now.frequencies:
            if name in known:
                self._compared += 1
                moves += self._moved(now.case, name, known[name], hz)
            else:
                self._new += 1
        self.moves += moves
        return moves

    def _moved(
        self, case: str, name: str, before: list[float], now: list[float]
    ) -> Iterator[Moved]:
        """The value that moved most, if it moved too far."""
        by, k = max((abs(a - b), k) for k, (a, b) in enumerate(zip(before, now, strict=True)))
        if by > self._tolerance:
            what, hz = f"{name}, {_STATISTICS[k]}", now[k] - before[k]
            yield Moved(case, what, f"{before[k]:.8g} Hz", f"{now[k]:.8g} Hz", hz)

    def table(self) -> Table:
        """The differences, and below them how much was compared.

        Raises UsageError where nothing was: the earlier result is of other cases then.
        """
        if not self._compared and not self.moves:
            some = ", ".join([*self._before][:5])
            raise UsageError(f"{self._path}: has none of these frequencies; its cases are {some}")
        caption = f"Frequencies compared: {self._compared}, new ones: {self._new}; "
        caption += f"tolerance {self._tolerance:g} Hz."
        if gone := [case for case in self._before if case not in self._seen]:
            some = ", ".join(gone[:5]) + (", …" if len(gone) > 5 else "")
            caption += f" Cases that are missing now: {len(gone)} ({some})."
        title = f"{'Moved' if self.moves else 'Nothing moved'} since {self._path}"
        return facts_table(title, self.moves, "case what before now hz", caption)


# --- Reading it


def _place(mode: int, where: str) -> str:
    return f"mode {mode}, {where}"


def _read(path: Path, kind: Kind) -> list[Known]:
    """Read the cases of a file or folder; raises UsageError where there are none."""
    found: list[Known] = []
    files = [path]
    if path.is_dir():
        batch, own = path / "summary.json", path / "results.json"
        below = sorted(path.glob("*/results.json"))
        files = [batch] if batch.exists() else [own] if own.exists() else below
    for file in files:
        try:
            for known in _known(json_value(read_bytes(file, TABLE)), kind):
                if not isinstance(known.case, str) or not isinstance(known.ended, str):
                    raise TypeError
                found.append(known)
        except OSError as error:
            raise UsageError(f"{file}: cannot be read: {error.strerror}") from error
        except (ValueError, LookupError, TypeError, AttributeError):
            expected = "results.json, summary.json, or what validate --json printed"
            raise UsageError(f"{file}: is not {expected}") from None
    if not any(known.frequencies for known in found):
        wanted = "answers of optimize or batch" if kind == "answers" else "a validation or a run"
        raise UsageError(f"{path}: has no frequencies to compare with; expected {wanted}")
    return found


def _known(document: Any, kind: Kind) -> Iterator[Known]:
    if isinstance(document, list):
        if kind == "validations":
            yield from _validations(document)
    elif "cases" in document:
        if kind == "answers":
            yield from (Known.of_outcome(from_plain(row)) for row in document["cases"])
    elif "not_identified" not in document:  # an update has no answer to compare
        yield _run(document, kind)


def _validations(rows: list[Any]) -> Iterator[Known]:
    by_case: dict[str, list[Range]] = {}
    for row in rows:
        if "lowest_hz" in row:
            hz = float(row["lowest_hz"]), float(row["mean_hz"]), float(row["highest_hz"])
            by_case.setdefault(row["case"], []).append((_place(row["mode"], row["where"]), *hz))
    yield from (Known(case, tuple(found)) for case, found in by_case.items())


def _run(document: Any, kind: Kind) -> Known:
    """Exact frequencies of an answer; for a validation those of modes at the initial design."""
    case, targets = document["case"]["name"], document["targets"]
    if kind == "answers":
        curves = []
        for t in targets:
            name = t["followed"]["name"] if t.get("followed") else f"mode {t['mode']}"
            name = TARGETS.get(t["kind"], HighestTarget).curve_of(name)
            curves.append((name, t.get("trajectory"), t["frequencies"]["exact_hz"]))
        return Known(case, ranges(curves), (document["assignment"] or {}).get("verdict", ""))
    samples = {row["name"]: row["samples"] for row in document["trajectories"]}
    found: dict[str, Range] = {}
    for target in targets:
        hz, name = target["frequencies"]["initial_hz"], target.get("trajectory")
        where = TRAJECTORY if len(samples) == 1 else f"{TRAJECTORY} {name!r}"
        whole = next(iter(samples.values())) if len(samples) == 1 else samples.get(name)
        form = TARGETS.get(target["kind"], HighestTarget)
        wanted = form.is_goal and target["mode"] is not None
        if wanted and len(hz) == whole:
            place = _place(target["mode"], where)
            found[place] = ranges([(place, None, hz)])[0]
    return Known(case, tuple(found.values()))
