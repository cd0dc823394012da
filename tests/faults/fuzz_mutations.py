"""Case files that were right once: shipped cases with some of their values and keys changed."""

import copy
import json
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml

CASES = Path(__file__).parents[2] / "cases"
FOLDER = Path(__file__).parent
EXTREME = (FOLDER / "fuzz_numbers.txt").read_text(encoding="utf-8").split("\n")
WORDS = (FOLDER / "fuzz_words.txt").read_text(encoding="utf-8").split("\n")
STRAY = ("", "[", "}", ": ", "&a ", "*a", "\n", "\t", "\0", "|", "é")
QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(.*)", re.DOTALL)
PLAIN = re.compile(r"[\w.+%°/·²³⁴^*()-][\w.+%°/·²³⁴^*() -]*[\w.+%°/·²³⁴^*()-]|[\w.+~%-]")
Key = str | int
Place = tuple[Any, Key]  # a container, and the key of a value in it


def shipped() -> dict[str, Any]:
    """Trees of all shipped cases, scalars as they are written, by the names of their files."""
    files = sorted(CASES.glob("**/*.yaml"))
    return {
        file.relative_to(CASES).as_posix(): yaml.load(file.read_text(), yaml.BaseLoader)
        for file in files
    }


def written(node: Any, depth: int = 0) -> str:
    """Tree → YAML: the upper levels in lines of their own, what is below in flow style."""
    if isinstance(node, dict) and node and depth < 3:
        pad = "  " * depth
        return "".join(
            f"{pad}{_scalar(k)}:{_below(value, depth)}\n" for k, value in node.items()
        ).rstrip("\n")
    return _flow(node)


def _below(value: Any, depth: int) -> str:
    block = isinstance(value, dict) and value and depth < 2
    return "\n" + written(value, depth + 1) if block else " " + _flow(value)


def _flow(node: Any) -> str:
    if isinstance(node, dict):
        return "{" + ", ".join(f"{_scalar(k)}: {_flow(v)}" for k, v in node.items()) + "}"
    if isinstance(node, list):
        return "[" + ", ".join(map(_flow, node)) + "]"
    return _scalar(node)


def _scalar(value: Any) -> str:
    text = str(value)
    return text if PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def places(tree: Any) -> Iterator[Place]:
    """Every value in a tree."""
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(pairs):
        yield tree, key
        if isinstance(value, (dict, list)):
            yield from places(value)


class Mutations:
    """Changes of trees, drawn from ``chance``."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.trees = shipped()
        self.donors: dict[Key, list[Any]] = {}
        self.words: list[Any] = []
        for tree in self.trees.values():
            for container, key in places(tree):
                name = key if isinstance(key, str) else "#"
                self.donors.setdefault(name, []).append(container[key])
                if isinstance(container[key], str):
                    self.words.append(container[key])
        self.everywhere: list[Callable[[Any, Key], None]] = [
            self.replaced,
            self.grafted,
            self.grafted,
            self.removed,
            self.renamed,
            self.repeated,
            self.exchanged,
            self.enriched,
        ]
        self.of_numbers: list[Callable[[Any, Key], None]] = [
            self.extreme,
            self.extreme,
            self.scaled,
            self.scaled,
        ]

    def case(self, limits: dict[str, str] | None = None) -> str:
        """A shipped case with one to five changes; ``limits`` are put under `assignment` before."""
        names = [n for n, tree in sorted(self.trees.items()) if limits is None or "targets" in tree]
        tree = copy.deepcopy(self.trees[self.chance.choice(names)])
        if limits is not None:
            tree["assignment"] = {**tree.get("assignment", {}), **limits}
        for _ in range(self.chance.choice((1, 1, 1, 2, 2, 3, 5))):
            self.change(tree)
        text = written(tree) + "\n"
        return self.scribbled(text) if self.chance.random() < 0.1 else text

    def change(self, tree: Any) -> None:
        """One change: of a number in three out of four times."""
        spots = list(places(tree))
        numbers = [(c, k) for c, k in spots if isinstance(c[k], str) and QUANTITY.fullmatch(c[k])]
        if numbers and self.chance.random() < 0.75:
            self.chance.choice(self.of_numbers)(*self.chance.choice(numbers))
        elif spots:
            self.chance.choice(self.everywhere)(*self.chance.choice(spots))

    def extreme(self, container: Any, key: Key) -> None:
        _, unit = QUANTITY.fullmatch(container[key]).groups()  # type: ignore[union-attr]
        number = self.chance.choice(EXTREME)
        container[key] = number + (unit if self.chance.random() < 0.5 else "")

    def scaled(self, container: Any, key: Key) -> None:
        number, unit = QUANTITY.fullmatch(container[key]).groups()  # type: ignore[union-attr]
        decades = self.chance.choice((0.1, 0.3, 1, 1, 2, 3, 6, 12, 100, 150)) * self.chance.choice(
            (1, -1)
        )
        sign = self.chance.choice((1, 1, 1, -1))
        container[key] = f"{sign * float(number) * 10**decades:.6g}{unit}"

    def replaced(self, container: Any, key: Key) -> None:
        pool = self.chance.choice((EXTREME, WORDS, self.words))
        container[key] = self.chance.choice(pool)

    def grafted(self, container: Any, key: Key) -> None:
        name = key if isinstance(key, str) else "#"
        container[key] = copy.deepcopy(self.chance.choice(self.donors.get(name, ["x"])))

    def removed(self, container: Any, key: Key) -> None:
        del container[key]

    def renamed(self, container: Any, key: Key) -> None:
        if isinstance(container, dict):
            name = self.chance.choice((f"{key}2", "start", "ground", "é", "type", "1", "a" * 70))
            container[name] = container.pop(key)

    def repeated(self, container: Any, key: Key) -> None:
        value = container[key]
        many = self.chance.choice((1, 1, 2, 50))
        if isinstance(container, list):
            container[int(key) : int(key)] = [copy.deepcopy(value) for _ in range(many)]
        else:
            container.update({f"{key}_{k}": copy.deepcopy(value) for k in range(many)})

    def exchanged(self, container: Any, key: Key) -> None:
        other = self.chance.choice(
            list(container) if isinstance(container, dict) else range(len(container))
        )
        container[key], container[other] = container[other], container[key]

    def enriched(self, container: Any, key: Key) -> None:
        value = container[key]
        if isinstance(value, dict) and isinstance(key, str):
            donor = self.chance.choice(self.donors[key]) if key in self.donors else None
            if isinstance(donor, dict) and donor:
                name = self.chance.choice(list(donor))
                value[name] = copy.deepcopy(donor[name])
                return
        self.grafted(container, key)

    def scribbled(self, text: str) -> str:
        """Some characters of a text lost, repeated, or in their place what is special in YAML."""
        for _ in range(self.chance.choice((1, 2, 5))):
            start = self.chance.randrange(len(text))
            end = start + self.chance.choice((0, 0, 1, 3, 20))
            stray = self.chance.choice(STRAY)
            text = text[:start] + stray + text[end:]
        return text
