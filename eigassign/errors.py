"""Every error eigassign raises on purpose; the command line turns each into its exit code."""

from __future__ import annotations

from dataclasses import dataclass

LIMP = (
    "the stiffness matrix is not positive definite: a link or drive has no stiffness, the springs "
    "hold fewer motions at this pose than elsewhere, or the weight buckles the mechanism"
)


class EigassignError(Exception):
    """Root of the tree. ``exit_code`` is what the command line returns for it."""

    exit_code = 4


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a case file: where, what, and what is allowed (1-based line, column).

    Of a case that was given as a mapping, line and column are 0.
    """

    file: str
    line: int
    column: int
    path: str
    message: str

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}:{self.column}: " if self.line else f"{self.file}: "
        return where + (f"{self.path}: " if self.path else "") + self.message


class CaseError(EigassignError):
    """The case file is wrong. ``problems`` lists everything found, in file order."""

    exit_code = 2

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self.problems = tuple(sorted(problems, key=lambda p: (p.line, p.column, p.path)))
        super().__init__("\n".join(str(p) for p in self.problems))


class UsageError(EigassignError):
    """A call that cannot be answered as asked: wrong length, unknown name, value out of range."""

    exit_code = 2


class MechanismError(EigassignError):
    """The mechanism cannot be modelled; ``path`` names the key at fault in the case file."""

    exit_code = 2

    def __init__(self, path: str, message: str) -> None:
        self.path = path
        self.message = message
        super().__init__(f"{path}: {message}")


class TrajectoryError(MechanismError):
    """The trajectory cannot be followed; ``sample`` is the first sample (0-based) that cannot.

    Between samples ``place`` says where: 1.5 is midway between the second and the third.
    """

    def __init__(self, path: str, message: str, sample: int, place: float | None = None) -> None:
        self.sample, self.place = sample, place
        super().__init__(path, message)


class TravelError(MechanismError):
    """A carriage or nut leaves its beam; ``sample`` is the first sample (0-based) where it does."""

    def __init__(self, path: str, message: str, sample: int) -> None:
        self.sample = sample
        super().__init__(path, message)


class MissingMassError(MechanismError):
    """More modes are asked for than have mass; ``most`` is how many of them can be told."""

    def __init__(self, most: int) -> None:
        self.most = most
        modes = f"only {most} modes" if most != 1 else "only 1 mode"
        super().__init__(
            "mechanism",
            f"has {modes} whose mass is more than round-off: add mass, ask for fewer modes, "
            "or take a pose in which springs hold all that moves freely",
        )


class AccuracyError(EigassignError):
    """A number was computed that cannot be vouched for, and is withheld."""

    exit_code = 1


@dataclass(frozen=True)
class Candidate:
    """A mode that may be the one looked for: its share of the shape is ``mac``, 0 to 1."""

    number: int
    hz: float
    mac: float

    def __str__(self) -> str:
        return f"mode {self.number} ({self.hz:.5g} Hz, MAC {self.mac:.2f})"


class LostModeError(EigassignError):
    """No mode has the shape that is followed; ``candidates`` are the nearest, the best first.

    ``step`` is the place on the way (0-based) at which it is lost.
    """

    exit_code = 1

    def __init__(self, candidates: tuple[Candidate, ...], step: int, message: str = "") -> None:
        self.candidates = candidates
        self.step = step
        nearest = " and ".join(map(str, candidates)) or "none of the modes"
        super().__init__(message or f"no mode has the shape that is followed; nearest: {nearest}")


class InfeasibleError(EigassignError):
    """No design meets all constraints; ``constraints`` names those that contradict each other."""

    exit_code = 1

    def __init__(self, message: str, constraints: tuple[str, ...]) -> None:
        self.constraints = constraints
        super().__init__(message)


class StorageError(EigassignError):
    """Reading or writing failed: no permission, no space, a folder in the way."""

    exit_code = 3


class SingularityError(EigassignError):
    """A configuration where the mechanism's equations have no unique solution: a dead point."""

    exit_code = 2
