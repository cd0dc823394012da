"""A run folder with an earlier run in it, a run that takes its place, and what may never happen."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from eigassign.cli import main
from eigassign.output import Cache, is_untouched, run_folder

Write = Callable[[Path, Path, bool], int]  # a whole run of a case file at a target; force

CASE = Path("cases/arm.yaml")
TARGET = Path("results/arm")
NAMES = ("case.yaml", "results.json", "figures/modes.png")
TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"
SHORT = (("samples: 152", "samples: 12"), ("order: 4", "order: 2"))
LITTLE = ("--study", "none", "--figures", "none")


def write_a_few_files(case: Path, target: Path, force: bool) -> int:
    """A run that costs nothing but its files."""
    with run_folder(target, case_path=case, key="a" * 64, force=force) as folder:
        (folder / "figures").mkdir()
        for name in NAMES:
            (folder / name).write_text(f"{name} of {os.getpid()}")
    return 0


def optimize(case: Path, target: Path, force: bool) -> int:
    """The whole command, with a cache beside its case."""
    os.chdir(case.parents[1])
    args = ["optimize", case, "--out", target, "--cache-dir", case.parents[1] / "cache"]
    with (
        contextlib.redirect_stdout(io.StringIO()),
        patch.dict(os.environ, EIGASSIGN_CACHE="always"),
    ):
        return main([*map(str, args), *LITTLE, *(["--force"] if force else [])])


def case_text() -> str:
    text = TWO_LINK.read_text()
    for old, new in SHORT:
        assert old in text
        text = text.replace(old, new)
    return text + "assignment: {method: one_shot}\n"


def empty_cache(scene: Scene) -> None:
    for entry in (scene.root / "cache").iterdir():
        entry.unlink()


def untouched(root: Path) -> Mapping[str, str]:
    """An earlier run as it was written; the user has nothing in it."""
    return {}


def added(root: Path) -> Mapping[str, str]:
    """The user put a file of their own into the earlier run."""
    (root / TARGET / "notes.md").write_text("precious")
    return {"notes.md": "precious"}


def edited(root: Path) -> Mapping[str, str]:
    """The user edited a file of the earlier run."""
    (root / TARGET / "case.yaml").write_text("precious")
    return {"case.yaml": "precious"}


def nothing(root: Path) -> Mapping[str, str]:
    """No earlier run."""
    shutil.rmtree(root / TARGET)
    return {}


def foreign(root: Path) -> Mapping[str, str]:
    """A folder that no run wrote, and --force."""
    shutil.rmtree(root / TARGET)
    (root / TARGET / "deep").mkdir(parents=True)
    (root / TARGET / "deep" / "thesis.tex").write_text("precious")
    return {"deep/thesis.tex": "precious"}


EARLIER = (untouched, added, edited, nothing, foreign)


@dataclass(frozen=True)
class Scene:
    """A folder with a case and an earlier run; ``mine`` is what the user has in that, by path."""

    root: Path
    earlier: Callable[[Path], Mapping[str, str]]
    mine: Mapping[str, str]
    before: Mapping[str, bytes] | None
    write: Write

    @property
    def target(self) -> Path:
        return self.root / TARGET

    def run(self) -> int:
        """The run that is stopped, and after that the next start."""
        return self.write(self.root / CASE, self.target, self.earlier is foreign)

    def start_in_vain(self) -> None:
        """A start that leaves no run, but sweeps up."""
        how = {"case_path": self.root / CASE, "key": "a" * 64, "force": True}
        with suppress(KeyboardInterrupt), run_folder(self.target, **how):  # type: ignore[arg-type]
            raise KeyboardInterrupt

    def whole(self) -> bool:
        """Whether there is at the target what was there before, or a whole new run."""
        if (found := snapshot(self.target)) == self.before:
            return True
        return bool(found) and is_untouched(self.target)

    def lost(self) -> list[str]:
        """What the user has, and is nowhere to be found."""
        everything = {path.read_bytes() for path in self.root.rglob("*") if path.is_file()}
        return [name for name, text in self.mine.items() if text.encode() not in everything]

    def left(self) -> list[str]:
        """What neither the user nor a run has put there, once the next run has ended."""
        kept = [f"{TARGET.name}.1"] if self.mine else []
        names = {path.name for path in self.target.parent.iterdir()}
        hidden = {path.name for path in self.root.rglob(".*")}
        return sorted(names - {TARGET.name, *kept} | hidden)

    def aside(self) -> bool:
        """Whether all that the user has is beside the target, under its own names."""
        folder = self.target.with_name(f"{TARGET.name}.1")
        found = snapshot(folder) or {}
        return all(found.get(name) == text.encode() for name, text in self.mine.items())


@dataclass(frozen=True)
class Stage:
    """Scenes all alike, one after the other."""

    folder: Path
    write: Write
    case_text: str = "title: arm\n"

    def scenes(self, earlier: Callable[[Path], Mapping[str, str]]) -> Iterator[Scene]:
        first = self.folder / "first"
        (first / CASE).parent.mkdir(parents=True)
        (first / CASE).write_text(self.case_text)
        self.write(first / CASE, first / TARGET, False)
        mine = earlier(first)
        before = snapshot(first / TARGET)
        while True:
            root = self.folder / "scene"
            shutil.copytree(first, root)
            yield Scene(root, earlier, mine, before, self.write)
            shutil.rmtree(root)


def snapshot(folder: Path) -> dict[str, bytes] | None:
    if not folder.exists():
        return None
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def faults(scene: Scene) -> list[str]:
    """What is wrong after a run was stopped, and after the next one."""
    found = [] if scene.whole() else ["neither the old run nor a new one is at the target"]
    found += [f"{name} is nowhere" for name in scene.lost()]
    if scene.run() != 0:
        found.append("the next run fails")
    found += [] if scene.whole() else ["the next run is not whole"]
    found += [] if scene.aside() else ["what was mine is not beside the next run"]
    cache = Cache(scene.root / "cache")
    damaged = [path for path in cache.directory.glob("*.h5") if cache.load(path.stem) is None]
    found += [f"{path.name} of the cache is damaged" for path in damaged]
    return found + [f"{name} is left" for name in scene.left()]
