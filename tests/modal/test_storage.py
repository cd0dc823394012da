"""A reduced model outlives its process bit for bit, and a damaged file is not believed."""

from __future__ import annotations

import json
import subprocess
import sys
from math import prod
from pathlib import Path

import numpy as np
import pytest
from chains import model_of, random_chain, two_link

from eigassign import api
from eigassign.errors import StorageError, UsageError
from eigassign.hdf5 import pack
from eigassign.modal import FORMAT, reduce, reduced_arrays, reduced_from_arrays

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
Q = Q0 + np.column_stack([np.zeros(9), np.linspace(-0.5, 0.5, 9)])


@pytest.fixture(scope="module")
def reduced():
    return reduce(model_of(two_link()).pencil, Q0, Y0, (1, 2), 2)


def test_a_file_gives_the_same_numbers_bit_for_bit(reduced, tmp_path):
    api.save_reduced(reduced, tmp_path / "arm.h5")
    loaded = api.load_reduced(tmp_path / "arm.h5")
    assert loaded.frequencies(Q, Y0).tobytes() == reduced.frequencies(Q, Y0).tobytes()
    assert loaded.error_estimate(Q, Y0).tobytes() == reduced.error_estimate(Q, Y0).tobytes()
    assert loaded.modes == reduced.modes


@pytest.mark.parametrize("seed", [1, 4, 12])
def test_any_mechanism_survives_as_arrays(seed):
    tree, q0 = random_chain(seed)
    built = reduce(model_of(tree).pencil, q0, [], (1,), 1)
    back = reduced_from_arrays(reduced_arrays(built))
    assert back.frequencies(q0 + 0.1, []).tobytes() == built.frequencies(q0 + 0.1, []).tobytes()
    assert (
        back.error_estimate(q0 + 2.0, []).tobytes() == built.error_estimate(q0 + 2.0, []).tobytes()
    )


def test_a_loop_survives_after_it_was_solved(tmp_path):
    case = api.load_case(Path(__file__).parents[2] / "cases" / "five_bar.yaml")
    model, q, y = case.model(), case.trajectory.q, case.initial_design
    built = reduce(model.pencil, q[0], y, (1,), 1)
    before = built.frequencies(q, y), built.slopes(q, y)[0]
    api.save_reduced(built, tmp_path / "loop.h5")
    loaded = api.load_reduced(tmp_path / "loop.h5")
    assert loaded.frequencies(q, y).tobytes() == before[0].tobytes()
    assert loaded.slopes(q, y)[0].tobytes() == before[1].tobytes()


def test_it_is_evaluated_where_there_is_no_mechanism(reduced, tmp_path):
    api.save_reduced(reduced, tmp_path / "arm.h5")
    code = (
        "import sys; from eigassign.output import load_reduced\n"
        "f = load_reduced(sys.argv[1]).frequencies([1.817, 5.4], [0.1, 0.1])\n"
        "assert not any(m.startswith('eigassign.case') for m in sys.modules)\n"
        "print(float(f[0, 0]).hex())"
    )
    run = [sys.executable, "-c", code, str(tmp_path / "arm.h5")]
    out = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    assert float.fromhex(out.strip()) == reduced.frequencies([1.817, 5.4], [0.1, 0.1])[0, 0]


@pytest.mark.parametrize("at", [0.02, 0.5, 0.97])
def test_one_flipped_bit_is_noticed(reduced, tmp_path, at):
    path = tmp_path / "arm.h5"
    api.save_reduced(reduced, path)
    data = bytearray(path.read_bytes())
    data[int(at * len(data))] ^= 1
    path.write_bytes(data)
    with pytest.raises(StorageError, match="not an intact reduced model"):
        api.load_reduced(path)


def test_a_missing_file_and_a_missing_folder_are_named(reduced, tmp_path: Path):
    with pytest.raises(StorageError, match="cannot read"):
        api.load_reduced(tmp_path / "none.h5")
    with pytest.raises(StorageError, match="cannot write"):
        api.save_reduced(reduced, tmp_path / "none" / "arm.h5")


@pytest.mark.parametrize("name", ["a\0.h5", "a\0.npz", "a\0.c", "a\0/b.h5"])
def test_a_name_that_no_file_can_have_is_refused(reduced, tmp_path: Path, name: str):
    with pytest.raises(StorageError, match="null"):
        api.save_reduced(reduced, f"{tmp_path}/{name}")
    with pytest.raises(StorageError, match="null"):
        api.load_reduced(f"{tmp_path}/{name}")


def spoilt(arrays, change):
    tree = json.loads(arrays["tree"].tobytes())
    change(tree["fields"])
    return {**arrays, "tree": np.frombuffer(json.dumps(tree).encode(), dtype=np.uint8)}


def test_a_file_of_another_version_or_kind_is_refused(reduced, tmp_path):
    for key in ("reduced model 0", "coefficients"):
        (tmp_path / "a.h5").write_bytes(pack(key, reduced_arrays(reduced), {}))
        with pytest.raises(StorageError, match=f"it holds '{key}', not 'reduced model"):
            api.load_reduced(tmp_path / "a.h5")


def test_only_known_classes_are_made(reduced):
    arrays = reduced_arrays(reduced)
    tree = json.loads(arrays["tree"].tobytes())
    tree["class"] = "Path"
    arrays["tree"] = np.frombuffer(json.dumps(tree).encode(), dtype=np.uint8)
    with pytest.raises(UsageError, match="not a reduced model"):
        reduced_from_arrays(arrays)


def with_an_empty_last_row(arrays):
    """Every matrix of the program ends at 0, as a list of rows does that was torn."""
    tree, integers = json.loads(arrays["tree"].tobytes()), arrays["integers"].copy()
    place = 0

    def visit(node):
        nonlocal place
        if isinstance(node, dict) and "array" in node:
            place += 0 if node["array"] == "f" else prod(node["shape"])
        for name, part in node.items() if isinstance(node, dict) else ():
            for each in part if isinstance(part, list) else [part]:
                visit(each)
            if name == "parts":
                integers[place - 1] = 0

    visit(tree)
    return {**arrays, "integers": integers}


NESTED = b'{"tuple": [' * 100_000
CHANGES = {
    "a number that is not finite": lambda a: {**a, "numbers": np.where(a["numbers"], np.nan, 0.0)},
    "a number less": lambda a: {**a, "numbers": a["numbers"][:-1]},
    "a number more": lambda a: {**a, "numbers": np.append(a["numbers"], 0.0)},
    "an index beyond the end": lambda a: {**a, "integers": a["integers"] + 10**9},
    "no tree": lambda a: {k: v for k, v in a.items() if k != "tree"},
    "a tree too deep": lambda a: {**a, "tree": np.frombuffer(NESTED, dtype=np.uint8)},
    "a tree too long": lambda a: {**a, "tree": np.full(3_000_000, 32, dtype=np.uint8)},
    "matrices without an end": with_an_empty_last_row,
    "a tuple": lambda a: spoilt(a, lambda fields: fields.update(points={"tuple": []})),
    "a count": lambda a: spoilt(a, lambda fields: fields.update(n_q=10**12)),
    "other modes": lambda a: spoilt(a, lambda fields: fields.update(modes={"tuple": [99]})),
    "a missing field": lambda a: spoilt(a, lambda fields: fields.pop("mass")),
    "no error terms": lambda a: spoilt(a, lambda fields: fields.update(certified=None)),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_cannot_be_a_model_is_refused_however_right_its_hash(reduced, tmp_path, change):
    data = pack(FORMAT, change(reduced_arrays(reduced)), {})
    (tmp_path / "a.h5").write_bytes(data)
    with pytest.raises(StorageError, match="not an intact reduced model: these arrays are not a"):
        api.load_reduced(tmp_path / "a.h5")
