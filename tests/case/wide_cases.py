"""Two valid case files that use every key of a mechanism between them."""

from pathlib import Path

PLANAR = Path(__file__).with_name("wide_planar.yaml").read_text(encoding="utf-8")

SPATIAL = Path(__file__).with_name("wide_spatial.yaml").read_text(encoding="utf-8")


def write(folder: Path, text: str) -> Path:
    """A file with the text, beside the matrix files that it names."""
    for name in ("K.mtx", "M.npz"):
        (folder / name).touch()
    path = folder / "case.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def changed(text: str, old: str, new: str) -> str:
    """``text`` with its only ``old`` replaced by ``new``."""
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)
