"""Scenes of the shipped arm and of its variants, ready to be studied."""

from pathlib import Path

from eigassign import load_case
from eigassign.pipeline import Stages, prepare
from eigassign.study import Scene

SHIPPED = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
HEAD = SHIPPED[: SHIPPED.index("# The paper draws")]  # mechanism and coordinates only


def scene_of(folder: Path, text: str) -> Scene:
    path = folder / "arm.yaml"
    path.write_text(text)
    case = load_case(path)
    with case.located():
        return prepare(case, Stages(lambda line: None), None)


def changed(*changes: tuple[str, str], text: str = SHIPPED) -> str:
    """The shipped case, or another text, with some of it replaced."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


def automatic(*changes: tuple[str, str]) -> str:
    """The shipped case with its expansion left to the program."""
    start, end = SHIPPED.index("expansion:"), SHIPPED.index("targets:")
    return changed(*changes, text=SHIPPED[:start] + SHIPPED[end:])
