"""What a notebook shows of a case or a result: figures that display themselves, tables as HTML."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from eigassign.errors import UsageError
from eigassign.output.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eigassign.output.figures.graph import FigurePlan


def drawn(plan: FigurePlan) -> Figure:
    """The figure of a plan; a notebook shows it, though pyplot never hears of it."""
    from eigassign.output.figures.paper import applied, draw, encoded

    figure = draw(plan)

    def png() -> bytes:
        with applied():
            return encoded(figure, "png")

    figure._repr_png_ = png  # type: ignore[attr-defined]
    return figure


class Pictured:
    """Base of results that have figures."""

    def plans(self) -> Mapping[str, FigurePlan]:
        """Its figures by name, undrawn; the first is the one to look at first."""
        raise NotImplementedError

    @property
    def figures(self) -> tuple[str, ...]:
        """Names that `plot` can draw: the figures of the report."""
        return tuple(self.plans())

    def plot(self, name: str | None = None) -> Figure:
        """One of ``figures``, without a name the first.

        A matplotlib figure, which a notebook shows; ``.savefig("arm.pdf")`` keeps it. Raises
        UsageError for an unknown name.
        """
        return drawn(self.plan(name))

    def plan(self, name: str | None = None) -> FigurePlan:
        """The figure of this name undrawn, without one the first; raises UsageError."""
        plans = self.plans()
        chosen = next(iter(plans)) if name is None else name
        if chosen not in plans:
            raise UsageError(f"no figure {name!r}; there are {', '.join(plans)}")
        return plans[chosen]


def html(lines: Sequence[str], tables: Sequence[Table] = (), plan: FigurePlan | None = None) -> str:
    """Lines of text, tables and one figure, for ``_repr_html_``."""
    parts = [f"<p>{escape(line)}</p>" for line in lines]
    parts += [_table(table) for table in tables if table.rows]
    if plan is not None:
        from eigassign.output.figures.paper import render

        image = base64.b64encode(render([plan])[f"{plan.name}.png"]).decode()
        parts.append(f'<img src="data:image/png;base64,{image}" alt="{escape(plan.alt)}">')
    return "\n".join(parts)


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in table.columns)
    rows = (
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    caption = f"<caption>{escape(table.title)}</caption>"
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
