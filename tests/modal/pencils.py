"""Small pencils made by hand: matrices that are given functions of x."""

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from eigassign.mechanism import Pencil
from eigassign.series import Recorder, Scalar, compile_program

Terms = Sequence[tuple[Scalar, np.ndarray]]


def pencil_of(recorder: Recorder, K: Terms, M: Terms, n_x: int) -> Pencil:
    """K = Σ f_i(x) K_i and M likewise, f_i numbers or expressions that are single atoms."""
    n = len(K[0][1])
    atoms = sorted({next(iter(f.terms)) for f, _ in [*K, *M] if not isinstance(f, float)})
    slot = {atom: k + 1 for k, atom in enumerate(atoms)}

    def weights(terms: Terms) -> sparse.csr_array:
        table = np.zeros((n * n, 1 + len(atoms)))
        for f, matrix in terms:
            if isinstance(f, float):
                table[:, 0] += f * matrix.ravel()
            else:
                ((atom, factor),) = f.terms.items()
                table[:, slot[atom]] += factor * matrix.ravel()
        return sparse.csr_array(table)

    rows, columns = (a.ravel().astype(np.intp) for a in np.indices((n, n)))
    return Pencil(
        n_dof=n,
        n_u=n,
        rigid=np.zeros(0, dtype=np.intp),
        rows=rows,
        columns=columns,
        stiffness=weights(K),
        mass=weights(M),
        program=compile_program(recorder, atoms, n_x),
        to_program=np.eye(n_x),
        shift=np.zeros(n_x),
        n_q=n_x,
    )


def crossing(gap: float) -> Pencil:
    """6 dofs, λ_1 and λ_2 ≈ 1 ∓ x_1 cross at x = 0 (gap = 0) or veer at that distance.

    Two blocks of three unknowns, each with its own bending of K and M in x, coupled by gap / 2 and
    seen in axes turned at random, so that nothing of the structure is left to see.
    """
    rng = np.random.default_rng(5)
    Q = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    recorder = Recorder()
    a, b = recorder.variable(0), recorder.variable(1)
    up, down = np.diag([1.0, 0, 0, 0, 0, 0]), np.diag([0, 0, 0, 1.0, 0, 0])
    inside = np.zeros((6, 6))
    inside[:3, :3], inside[3:, 3:] = (0.1 * (s + s.T) for s in rng.standard_normal((2, 3, 3)))
    inside[0, 0] = inside[3, 3] = 0.0
    heavy = np.kron(np.eye(2), 0.2 * np.ones((3, 3)))
    couple = np.zeros((6, 6))
    couple[0, 3] = couple[3, 0] = 0.5 * gap
    base = np.diag([1.0, 4.0, 6.0, 1.0, 5.0, 7.0]) + couple
    K = [(1.0, base), (a, up - down), (a, inside), (b, inside), (a * b, 0.3 * (up + down))]
    M = [(1.0, np.eye(6)), (b, np.diag(np.diag(heavy))), (a * a, heavy), (b * b, heavy)]
    turned = [[(f, Q @ m @ Q.T) for f, m in terms] for terms in (K, M)]
    return pencil_of(recorder, turned[0], turned[1], 2)
