"""Superelements: an exported beam is the beam again, reduced it converges, wrong ones are named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imported_parts import ELEMENTS, FLAT, LENGTH, arm, beam_arm, exported, part, write
from spatial_cases import ALLOY, built
from spatial_oracle import Tree, element, section

import eigassign as ea
from eigassign.errors import CaseError, MechanismError


def lam(folder: Path, tree: Tree, count: int = 6) -> np.ndarray:
    return built(tree, folder / "case.yaml").lam([0.4, 0.9], count)


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("kind", ["mtx", "npy", "npz"])
def test_an_exported_beam_is_the_beam_it_was_exported_from(
    tmp_path: Path, space: str, kind: str
) -> None:
    files = write(tmp_path, kind, *exported(space))
    tree = arm(space, {"part": part(space, files)})
    exact = built(beam_arm(space)).lam([0.4, 0.9], 8)
    np.testing.assert_allclose(lam(tmp_path, tree, 8), exact, rtol=1e-8)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_craig_bampton_converges_from_above_with_the_modes_it_keeps(
    tmp_path: Path, space: str
) -> None:
    files = write(tmp_path, "npy", *exported(space))
    exact = built(beam_arm(space)).lam([0.4, 0.9], 4)
    error, size = [], []
    for hertz in (50.0, 1500.0, 5000.0, 20000.0, 1e9):
        tree = arm(space, {"part": part(space, files, reduce_to=hertz)})
        model = built(tree, tmp_path / "case.yaml")
        error.append(model.lam([0.4, 0.9], 4) / exact - 1.0)
        size.append(model.pencil.n_dof)
    assert size == sorted(set(size))  # each keeps more
    assert (np.array(error) > -1e-8).all()
    assert (np.diff(np.array(error), axis=0) < 1e-8).all()
    assert error[0].max() > 1e-2
    assert error[3].max() < 1e-4
    np.testing.assert_allclose(error[-1], 0.0, atol=1e-8)


def bent() -> tuple[np.ndarray, np.ndarray]:
    """Free-free K, M of an L: ELEMENTS along x, then as many along y."""
    n = 6 * (2 * ELEMENTS + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    R = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for e in range(2 * ELEMENTS):
        turn = np.kron(np.eye(4), R if e >= ELEMENTS else np.eye(3))
        at = slice(6 * e, 6 * e + 12)
        for A, a in zip(
            (K, M), element(ALLOY, lambda _: section(FLAT), 0.0375, False), strict=True
        ):
            A[at, at] += turn.T @ a @ turn
    return (K + K.T) / 2.0, (M + M.T) / 2.0


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_a_bent_part_s_dofs_does_not_matter(tmp_path: Path, seed: int) -> None:
    def eigenvalues(order: np.ndarray) -> np.ndarray:
        matrices = (A[np.ix_(order, order)] for A in bent())
        row = np.argsort(order)
        side = 0.0375 * ELEMENTS
        nodes = {
            "start": {"position": [0.0, 0.0, 0.0], "dofs": row[:6].tolist()},
            "end": {"position": [side, side, 0.0], "dofs": row[-6:].tolist()},
        }
        files = write(tmp_path, "npy", *matrices)
        link = {**part("spatial", files), "nodes": nodes}
        return lam(tmp_path, arm("spatial", {"part": link}))

    plain = np.arange(6 * (2 * ELEMENTS + 1))
    mixed = np.random.default_rng(seed).permutation(plain)
    np.testing.assert_allclose(eigenvalues(mixed), eigenvalues(plain), rtol=1e-8)


@pytest.mark.parametrize("reduce_to", [20.0, 3e3])
def test_few_masses_on_many_springs_have_their_modes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reduce_to: float
) -> None:
    """Of 160 nodes three have mass: those of the whole part, and a bound that holds."""
    n = 160
    K, M = np.zeros((3 * n, 3 * n)), np.zeros((3 * n, 3 * n))
    k, _ = element(ALLOY, lambda _: section(FLAT), LENGTH / (n - 1), False)
    flat = np.ix_([0, 1, 5, 6, 7, 11], [0, 1, 5, 6, 7, 11])
    for e in range(n - 1):
        K[3 * e : 3 * e + 6, 3 * e : 3 * e + 6] += k[flat]
    for node in (40, 80, 120):
        M[3 * node, 3 * node] = M[3 * node + 1, 3 * node + 1] = 0.3
    files = write(tmp_path, "npz", K, M)
    nodes = {
        "start": {"position": [0.0, 0.0], "dofs": [0, 1, 2]},
        "end": {"position": [LENGTH, 0.0], "dofs": [3 * n - 3, 3 * n - 2, 3 * n - 1]},
    }
    link = {"type": "superelement", "stiffness": files[0], "mass": files[1], "nodes": nodes}
    q = np.array([[0.4, 0.9]])
    monkeypatch.chdir(tmp_path)
    whole, small = (
        ea.load_case(arm("planar", {"part": each}) | {"title": "few masses"}).model()
        for each in (link, link | {"reduce_to": reduce_to})
    )
    exact, found = (model.frequencies(q, [], 3)[0] for model in (whole, small))
    bound = small.truncation_error(q, [], (1, 2, 3))[0]
    assert (found > exact * (1.0 - 1e-6)).all()
    assert (found <= exact * (1.0 + bound + 1e-6)).all()
    assert bound[0] < 0.5


@pytest.mark.parametrize("power", [-290, -150, 29, 31, 160, 307])
@pytest.mark.parametrize("what", ["both", "one", "mass"])
def test_entries_of_any_size_are_read_or_refused(tmp_path: Path, power: int, what: str) -> None:
    K, M = exported("planar")
    scale = 10.0**power
    if what == "both":
        K, M = K / abs(K).max() * scale, M / abs(M).max() * scale
    elif what == "mass":
        M = M / abs(M).max() * scale
    else:
        K[4, 4] = scale
    tree = arm("planar", {"part": part("planar", write(tmp_path, "npy", K, M), reduce_to=4e3)})
    try:
        _ = built(tree, tmp_path / "case.yaml").pencil
    except MechanismError as error:
        assert power < 31 or "beyond 1e+30" in error.message  # noqa: PT017


# Wrong ones


def refused(tmp_path: Path, link: Tree, path: str, message: str) -> None:
    with pytest.raises(MechanismError, match=message) as caught:
        _ = built(arm("planar", {"part": link}), tmp_path / "case.yaml").pencil
    assert caught.value.path == f"mechanism.links.part.{path}"


@pytest.fixture
def good(tmp_path: Path) -> Tree:
    return part("planar", write(tmp_path, "npy", *exported("planar")))


OUTSIDE = ("dofs", "nodes", "different and within 0 to 26")
OTHER = ("dofs", "stiffness", "strains under rigid motion")
ELSEWHERE = ("position", "stiffness", "positions or dof numbers")


@pytest.mark.parametrize(
    ("wrong", "value"),
    [
        *((OUTSIDE, dofs) for dofs in ([24, 25, 27], [24, 25, 25], [0, 1, 2])),
        *((OTHER, dofs) for dofs in ([25, 24, 26], [24, 26, 25], [21, 22, 23], [24, 22, 26])),
        *((ELSEWHERE, at) for at in ([0.5, 0.0], [0.6, 0.1], [-0.6, 0.0], [600.0, 0.0])),
    ],
)
def test_dof_numbers_and_positions_that_do_not_fit_the_matrix_are_refused(
    tmp_path: Path, good: Tree, wrong: tuple[str, str, str], value: list[float]
) -> None:
    key, path, message = wrong
    good["nodes"]["end"][key] = value
    refused(tmp_path, good, path, message)


def test_negative_dof_numbers_are_refused_in_the_file(tmp_path: Path, good: Tree) -> None:
    good["nodes"]["end"]["dofs"] = [-1, 25, 26]
    with pytest.raises(CaseError, match=">= 0"):
        built(arm("planar", {"part": good}), tmp_path / "case.yaml")


def entry(A: np.ndarray, at: int, value: float) -> np.ndarray:
    """The matrix with another entry on its diagonal."""
    A[at, at] = value
    return A


def by_direction(M: np.ndarray) -> np.ndarray:
    """All u_x, then all u_y, then θ."""
    order = np.argsort(np.arange(len(M)) % 3, kind="stable")
    return M[np.ix_(order, order)]


WRONG: list[tuple[Any, str, str]] = [
    (lambda K, M: (entry(K, 1, K[1, 1] + 1e6), M), "stiffness", "supports"),
    (lambda K, M: (entry(K, 2, 1.001 * K[2, 2]), M), "stiffness", "supports"),  # of a rotation
    (lambda K, M: (K, M[:-1, :-1]), "mass", "24|26"),
    (lambda K, M: (K[:-1], M), "stiffness", "square"),
    (lambda K, M: (K, entry(M, 0, np.nan)), "mass", "finite"),
    (lambda K, M: (-K, M), "stiffness", "positive semidefinite"),
    (lambda K, M: (K, -M), "mass", "positive semidefinite"),
    # positive on the diagonal and in sum, but not between two neighbours
    (lambda K, M: (K, entry(M, 13, 0.2 * M[13, 13])), "mass", "semidefinite"),
    (lambda K, M: (K, by_direction(M)), "mass", "order of the"),
    (lambda K, M: (np.triu(K), M), "stiffness", "one triangle only: say 'symmetric'"),
]


@pytest.mark.parametrize(("spoil", "key", "message"), WRONG)
def test_matrices_that_are_of_no_part_are_refused(
    tmp_path: Path, spoil: Any, key: str, message: str
) -> None:
    files = write(tmp_path, "npy", *spoil(*exported("planar")))
    refused(tmp_path, part("planar", files), key, message)


def test_rotations_without_inertia_are_fine(tmp_path: Path) -> None:
    """Lumped masses, nothing on the rotations; reduced or not."""
    K, M = exported("planar")
    lumped = np.zeros(len(M))
    for at in range(0, len(M), 3):
        lumped[at : at + 2] = M[at, ::3].sum()
    files = write(tmp_path, "mtx", K, np.diag(lumped))
    whole = lam(tmp_path, arm("planar", {"part": part("planar", files)}), 3)
    small = lam(tmp_path, arm("planar", {"part": part("planar", files, reduce_to=2e4)}), 3)
    np.testing.assert_allclose(whole, built(beam_arm("planar")).lam([0.4, 0.9], 3), rtol=0.05)
    np.testing.assert_allclose(small, whole, rtol=1e-5)


def test_a_part_with_something_loose_inside_is_refused(tmp_path: Path) -> None:
    K, M = exported("planar")
    wide = [np.zeros((len(K) + 3, len(K) + 3)) for _ in range(2)]
    for A, B in zip(wide, (K, M), strict=True):
        A[:-3, :-3] = B
    wide[1][-3:, -3:] = 0.1 * np.eye(3)
    files = write(tmp_path, "npy", *wide)
    tree = arm("planar", {"part": part("planar", files)})
    with pytest.raises(MechanismError, match=r"links\.part: is loose inside"):
        _ = built(tree, tmp_path / "case.yaml").pencil


def test_integers_and_single_precision_are_read(tmp_path: Path) -> None:
    """K rounded to whole N/m, and single precision M."""
    K, M = exported("planar")
    lower = [f"{i + 1} {j + 1} {round(K[i, j])}" for j in range(27) for i in range(j, 27)]
    header = f"%%MatrixMarket matrix coordinate integer symmetric\n% of ours\n27 27 {len(lower)}\n"
    (tmp_path / "K.mtx").write_text(header + "\n".join(lower) + "\n")
    np.save(tmp_path / "M.npy", M.astype(np.float32))
    found = lam(tmp_path, arm("planar", {"part": part("planar", ("K.mtx", "M.npy"))}), 3)
    np.testing.assert_allclose(found, built(beam_arm("planar")).lam([0.4, 0.9], 3), rtol=1e-4)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("K.npy", np.eye(27, dtype=complex), "complex entries"),
        ("K.npy", np.ones(27), "not a square matrix"),
        ("K.npy", np.eye(27, dtype=bool), "expected real numbers"),
        ("K.npy", np.full((27, 27), "x"), "expected real numbers"),
        ("K.npz", np.eye(27), "strains under rigid motion"),
    ],
)
def test_arrays_that_are_no_stiffness_are_refused(
    tmp_path: Path, good: Tree, name: str, array: np.ndarray, message: str
) -> None:
    save: Any = np.save if name.endswith("npy") else np.savez
    save(tmp_path / name, array)
    good["stiffness"] = name
    refused(tmp_path, good, "stiffness", message)
