"""Small writers of the formats of other programs, to read what they wrote."""

import struct
from pathlib import Path

import numpy as np
from scipy import io, sparse

Labels = list[tuple[int, int]]  # node and freedom of each row


def lower(A: np.ndarray) -> list[tuple[int, int]]:
    return [(i, j) for j in range(len(A)) for i in range(j, len(A)) if A[i, j]]


def dmig(name: str, A: np.ndarray, labels: Labels, wide: bool = True, e: str = "D") -> str:
    """One triangle, by columns, with ten digits or, in narrow fields, as many as there is room."""
    w, star = (16, "*") if wide else (8, "")
    cells = ["0", "6", "2" if wide else "1", "0", "", "", ""]
    out = [f"{'DMIG':<8}{name:<8}" + "".join(f"{c:>8}" for c in cells) + f"{len(A):>8}"]
    for j, (node, freedom) in enumerate(labels):
        rows = [i for i in range(j, len(A)) if A[i, j]]
        groups = [f"{labels[i][0]:>{w}}{labels[i][1]:>{w}}" + number(A[i, j], w, e) for i in rows]
        if not groups:
            continue
        start = f"{'DMIG' + star:<8}{name:<{w}}{node:>{w}}{freedom:>{w}}"
        if wide:
            out += [start, *(f"{'*':<8}{group}" for group in groups)]
        else:
            out.append(f"{start}{'':8}{groups[0]}")
            pairs = [groups[k : k + 2] for k in range(1, len(groups), 2)]
            out += [" " * 8 + "".join(f"{group:<32}" for group in pair).rstrip() for pair in pairs]
    return "\n".join(out) + "\n"


def number(value: float, width: int, e: str) -> str:
    if width == 16:
        return f"{value:16.9E}".replace("E", e)
    mantissa, exponent = f"{value:.2E}".split("E")  # 1.23+4, without a letter
    return f"{mantissa}{int(exponent):+d}".rjust(8)


def grids(places: dict[int, tuple[float, float, float]], wide: bool = False) -> str:
    w, star = (16, "*") if wide else (8, "")
    out = []
    for node, (x, y, z) in places.items():
        line = f"{'GRID' + star:<8}{node:>{w}}{'':{w}}{x:>{w}.4f}{y:>{w}.4f}"
        out.append(line + (f"\n{'*':<8}" if wide else "") + f"{z:>{w}.4f}")
    return "\n".join(out) + "\n"


def strings(A: np.ndarray, j: int) -> list[tuple[int, np.ndarray]]:
    """Runs of entries that are not zero: first row from 1, values."""
    rows = np.flatnonzero(A[:, j])
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [(int(run[0]) + 1, A[run, j]) for run in runs if len(run)]


def op4_text(name: str, A: np.ndarray, layout: str, width: int = 23) -> str:
    n, digits = len(A), width - 7
    most = 80 // width
    rows = -n if layout == "bigmat" else n
    out = [f"{n:8d}{rows:8d}{6:8d}{2:8d}{name:<8}1P,{most}E{width}.{digits}"]

    def put(values: np.ndarray) -> None:
        texts = [f"{v:{width}.{digits}E}" for v in values]
        out.extend("".join(texts[k : k + most]) for k in range(0, len(texts), most))

    for j in range(n):
        runs = strings(A, j)
        if layout == "dense":
            first, last = runs[0][0], runs[-1][0] + len(runs[-1][1]) - 1
            out.append(f"{j + 1:8d}{first:8d}{2 * (last - first + 1):8d}")
            put(A[first - 1 : last, j])
            continue
        head = 2 if layout == "bigmat" else 1
        out.append(f"{j + 1:8d}{0:8d}{sum(head + 2 * len(v) for _, v in runs):8d}")
        for row, values in runs:
            words = 2 * len(values) + 1
            out.append(f"{words:8d}{row:8d}" if head == 2 else f"{65536 * words + row:12d}")
            put(values)
    return "\n".join([*out, f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:{width}.{digits}E}"]) + "\n"


def op4_binary(name: str, A: np.ndarray, layout: str, order: str = "<", size: int = 8) -> bytes:
    n, per = len(A), size // 4
    rows = -n if layout == "bigmat" else n

    def record(*whole: int, body: bytes = b"") -> bytes:
        data = struct.pack(f"{order}{len(whole)}i", *whole) + body
        mark = struct.pack(f"{order}i", len(data))
        return mark + data + mark

    out = record(n, rows, 6, per, body=name.ljust(8).encode())
    for j in range(n):
        runs = strings(A, j)
        if layout == "dense":
            first, last = runs[0][0], runs[-1][0] + len(runs[-1][1]) - 1
            body = A[first - 1 : last, j].astype(f"{order}f{size}").tobytes()
            out += record(j + 1, first, len(body) // 4, body=body)
            continue
        body = b""
        for row, values in runs:
            words = per * len(values) + 1
            heads = (words, row) if layout == "bigmat" else (65536 * words + row,)
            body += struct.pack(f"{order}{len(heads)}i", *heads)
            body += values.astype(f"{order}f{size}").tobytes()
        out += record(j + 1, 0, len(body) // 4, body=body)
    return out + record(n + 1, 1, per, body=np.ones(1, f"{order}f{size}").tobytes())


def abaqus_labels(A: np.ndarray, labels: Labels) -> str:
    return "".join(
        f"{labels[i][0]},{labels[i][1]}, {labels[j][0]},{labels[j][1]}, {A[i, j]:.17e}\n"
        for i, j in lower(A)
    )


def coordinate(A: np.ndarray) -> str:
    """Of Abaqus and CalculiX: one triangle, rows from 1."""
    return "".join(f"{j + 1} {i + 1} {A[i, j]:.17e}\n" for i, j in lower(A))


def dofs(labels: Labels) -> str:
    return "".join(f"{node}.{freedom}\n" for node, freedom in labels)


def mapping(labels: Labels) -> str:
    words = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
    rows = (f"{k:10d}{n:10d}  {words[f - 1]}" for k, (n, f) in enumerate(labels, start=1))
    return "\n".join(["  Matrix Eqn     Node  DOF", *rows]) + "\n"


def matlab(file: Path, matrices: dict[str, np.ndarray], version: str, packed: bool = True) -> None:
    held = {name: sparse.csc_array(A) if version != "full" else A for name, A in matrices.items()}
    io.savemat(file, held, do_compression=packed)
