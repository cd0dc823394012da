"""Files that runs and batches have left, and what becomes of them: bytes and JSON mutated.

`Stage` makes the folders once; `Stage.trial` damages one file of a copy of them and says which
command reads it. A file that is vouched for by a hash has it made anew in half of the trials, as
somebody would who wants to be believed.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from beam import TEXT
from fuzz_mutations import places
from fuzz_worker import Outcome, Worker

RUN = ("--out", "run", "--study", "none", "--figures", "none", "--report", "none", "--no-cache")
SWEEP = ("batch", "beam.yaml", "--set", "targets.0.frequency=185 Hz,190 Hz,1 Hz", "--jobs", "1")
SWEEP = (*SWEEP, "--reports", "none", "--out")
AGAIN = (*SWEEP, "out")
DRY, AGAINST = (*AGAIN, "--dry-run"), (*AGAIN, "--against", "out")
OPTIMIZE = ("optimize", "beam.yaml", *RUN)
MADE = (AGAIN, OPTIMIZE)
ONE = "frequency=190Hz"  # a case of the sweep
READ: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...] = (
    (f"out/{ONE}/run.json", (AGAIN, DRY)),
    (f"out/{ONE}/results.json", (AGAIN,)),
    ("out/summary.json", (AGAINST, AGAIN)),
    ("run/run.json", (OPTIMIZE,)),
    ("run/results.json", (("validate", "beam.yaml", "--against", "run"), OPTIMIZE)),
)


@dataclass(frozen=True)
class Trial:
    """A command on folders of which one file is damaged."""

    root: Path
    damaged: str
    what: str  # became of the file
    command: tuple[str, ...]
    believed: bool  # it has the hash that goes with its content, or there is none
    before: dict[str, Any]

    def faults(self, worker: Worker) -> list[str]:
        """What no damage may lead to: see `Outcome.excesses`.

        Where nothing vouches for the damaged file, the command ends as if there were no damage, or
        its error names the file, or its folder.
        """
        outcome = worker.ran(self.command, self.root, str(self))
        found = outcome.excesses()
        folder = self.damaged.partition("/")[0]
        if outcome.code > 1 and folder not in outcome.err:
            found.append("refused without the name of the file")
        if outcome.code in (0, 1) and not self.believed and not self._is_as_before():
            found.append("something else than without the damage")
        return [f"{self}: {fault}\n{outcome.err}" for fault in found]

    def _is_as_before(self) -> bool:
        try:
            return made(self.root) == self.before
        except (ValueError, RecursionError):
            return False

    def __str__(self) -> str:
        return f"{self.damaged}, {self.what}; {' '.join(self.command)}"


def made(root: Path) -> dict[str, Any]:
    """What the batch says, but for times."""
    rows = json.loads((root / "out" / "summary.json").read_text())["cases"]
    return {"out": [{**row, "seconds": 0} for row in rows]}


class Stage:
    """Folders of a run and a batch; and damages drawn from them."""

    def __init__(self, folder: Path, worker: Worker) -> None:
        self._first, self._scene, self._worker = folder / "first", folder / "scene", worker
        self._first.mkdir()
        (self._first / "beam.yaml").write_text(TEXT)
        for command in MADE:
            assert self._ran(command, self._first).code in (0, 1)
        assert len(made(self._first)["out"]) == 3
        self._whole: dict[tuple[tuple[str, ...], str], dict[str, Any]] = {}

    def _ran(self, command: tuple[str, ...], folder: Path) -> Outcome:
        outcome = self._worker.ran(command, folder)
        assert outcome.code in (0, 1), outcome.err
        return outcome

    def _copied(self) -> Path:
        shutil.rmtree(self._scene, ignore_errors=True)
        shutil.copytree(self._first, self._scene)
        return self._scene

    def trials(self, seed: int, count: int) -> Iterator[Trial]:
        """So many, the same for the same seed."""
        draw = random.Random(seed)
        for _ in range(count):
            yield self.trial(draw)

    def trial(self, draw: random.Random) -> Trial:
        """A file, a damage of it and a command, drawn."""
        name, commands = draw.choice(READ)
        command = draw.choice(commands)
        if (command, name) not in self._whole:
            self._ran(command, self._copied())
            self._whole[command, name] = made(self._scene)
        path, sealed = self._copied() / name, draw.random() < 0.5
        what, vouched = _damaged(path, draw, sealed)
        plain = path.name == "summary.json" and command == AGAINST  # it has no hash
        believed = vouched or plain or path.parent.name == "run"
        return Trial(self._scene, name, what, command, believed, self._whole[command, name])


# --- Damages


def _damaged(path: Path, draw: random.Random, sealed: bool) -> tuple[str, bool]:
    """Damage a file; what became of it, and whether it has a hash that goes with its content."""
    kinds = (_replaced, _scribbled, _scribbled, *[_reworded] * 7)
    kind = draw.choice(kinds)
    if kind is _reworded:
        return _reworded(path, draw, sealed)
    return kind(path, draw), False


def _replaced(path: Path, draw: random.Random) -> str:
    """Something else than a file of this size."""

    def endless() -> None:
        path.unlink()
        path.symlink_to("/dev/zero")

    def huge() -> None:
        os.truncate(path, 2**40)

    def folder() -> None:
        path.unlink()
        path.mkdir()

    def pipe() -> None:
        path.unlink()
        os.mkfifo(path)

    def itself() -> None:
        path.unlink()
        path.symlink_to(path.name)

    how = draw.choice((path.unlink, endless, huge, folder, pipe, itself))
    how()
    return f"replaced ({how.__name__})"


def _scribbled(path: Path, draw: random.Random) -> str:
    """Other bytes, or other codes for the same text."""
    data = path.read_bytes()
    at = draw.randrange(len(data))
    end = min(len(data), at + draw.choice((1, 8, 64, 512, 4096)))
    forms: dict[str, Callable[[], bytes]] = {
        "cut": lambda: data[:at],
        "emptied": lambda: b"",
        "first lost": lambda: data[at:],
        "bit": lambda: data[:at] + bytes([data[at] ^ 1 << draw.randrange(8)]) + data[at + 1 :],
        "zeros": lambda: data[:at] + bytes(end - at) + data[end:],
        "ones": lambda: data[:at] + b"\xff" * (end - at) + data[end:],
        "noise": lambda: data[:at] + draw.randbytes(end - at) + data[end:],
        "lost": lambda: data[:at] + data[end:],
        "repeated": lambda: data[:end] + data[at:],
        "doubled": lambda: data + data,
        "grown": lambda: data + draw.choice((b"\0", b"}", b"\n", b"[" * 10**6, b" " * 10**7)),
        "lines": lambda: data.replace(b"\n", b"\r\n"),
        "joined": lambda: data.replace(b"\n", b" "),
        **{
            code: lambda code=code: data.decode("latin-1").encode(code)  # type: ignore[misc]
            for code in ("utf-16", "utf-32", "utf-8-sig", "utf-7", "cp037")
        },
    }
    name = draw.choice([*forms])
    path.write_bytes(forms[name]())
    return f"{name} at {at}" if path.read_bytes() != data else "as it was"


DEEP = 100_000
NUMBERS = (
    *("0", "-1", "1", "1.5", "-0.0", "1e308", "-1e308", "1e-320", "1e999", "-1e999"),
    *("NaN", "Infinity", "-Infinity", "1" * 400, "-" + "9" * 30, "1" * 5000, "300000000"),
)
TEXTS = (
    *('""', '"0"', '"\\u0000"', '"\\ud800"', '"\\udcff"', '"a\\nb"', '"\\u001b[2J"', '"\\u202e"'),
    *('"/"', '"."', '".."', '"../../../etc/passwd"', '"/dev/zero"', '"~"', '"=1+1"', '"<b>"'),
    *('"a/b"', '"' + "x" * 300 + '"', '"' + "x" * 10**6 + '"', '"é"', '"ok"', '"error"', '"1e999"'),
)
TOKENS = (
    *NUMBERS,
    *TEXTS,
    *("null", "true", "false"),
    *("[]", "{}", "[[]]", "[null]", '{"": null}', "[1, 2, 3]", '["a", 1, 2, 3]', '["a", 1e999]'),
    *("[" * 300 + "]" * 300, "[" * 900 + "]" * 900, "[" * DEEP + "]" * DEEP, "[" * DEEP),
    '{"a": ' * 400 + "1" + "}" * 400,
    json.dumps(["beam.yaml"] * 100),
)
_HERE = "@here@"


def _reworded(path: Path, draw: random.Random, sealed: bool) -> tuple[str, bool]:
    """JSON that says something else, in up to three places."""
    whole, done = json.dumps(json.loads(path.read_text())), []
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        whole, what = _changed(json.loads(whole), draw)
        done.append(what)
        try:
            json.loads(whole)
        except (ValueError, RecursionError):
            break
    path.write_text(whole)
    vouched = sealed and _sealed(path.parent)
    return f"{', '.join(done)}{', with its hash' if vouched else ''}", vouched


def _changed(tree: Any, draw: random.Random) -> tuple[str, str]:
    """JSON of a tree that has changed in a place; what was done."""
    spots = list(places(tree)) if isinstance(tree, (dict, list)) else []
    if not spots or draw.random() < 0.02:
        token = draw.choice(TOKENS)
        return token, f"all is {token:.30}"
    inner, key = draw.choice(spots)
    value = inner[key]
    alike = TEXTS if isinstance(value, str) else NUMBERS if isinstance(value, float) else TOKENS
    token = draw.choice(draw.choice((alike, TOKENS)))
    how = draw.choice(("other", "other", "other", "gone", "renamed", "twice", "more", "exchanged"))
    if how == "other":
        inner[key] = _HERE
    elif how == "gone":
        del inner[key]
    elif how == "renamed" and isinstance(inner, dict):
        inner[f"{key}2"] = inner.pop(key)
    elif how == "twice" and isinstance(inner, dict):
        inner[_HERE] = None
        token = f"{json.dumps(key)}: {token}, {json.dumps(key)}"
    elif how == "twice" or (how == "more" and isinstance(inner, list)):
        inner += [value] * draw.choice((1, 2, 50))
    elif how == "exchanged":
        other, place = draw.choice(spots)
        if isinstance(value, (dict, list)) or isinstance(other[place], (dict, list)):
            inner[key] = str(value)
        else:
            inner[key], other[place] = other[place], value
    else:
        inner["a" if isinstance(inner, dict) else 0] = _HERE
    text = json.dumps(tree).replace(f'"{_HERE}": null', f"{token}: null")
    return text.replace(f'"{_HERE}"', token), f"{key} {how} {token:.30}"


def _sealed(folder: Path) -> bool:
    """Make run.json say the hash that goes with what it says and with the files it lists."""
    record = folder / "run.json"
    try:
        content = json.loads(record.read_text())
        content.pop("sha256", None)
        digests = [hashlib.sha256((folder / n).read_bytes()).hexdigest() for n in content["files"]]
        own = hashlib.sha256((json.dumps(content) + "".join(digests)).encode()).hexdigest()
        text = json.dumps({**content, "sha256": own}, indent=2)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError, OSError):
        return False
    record.write_text(text + "\n")
    return True
