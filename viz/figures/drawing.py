"""A figure of a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Drawing(NamedTuple):
    """A figure, the file it goes to, and what it shows."""

    file: str
    caption: str
    figure: Figure
