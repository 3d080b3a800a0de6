"""What a benchmark finds: rows with a figure of ours and a figure of a peer, in parts that share a
question.
"""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["Part", "Row"]


@dataclass(frozen=True)
class Row:
    """One quantity: our figure, the peer's, what they are of.

    theirs: None where the quantity stands for itself. at_most: budget of the ratio ours / theirs, or of
    `ours` where it stands for itself. note: what a reader must know beside the figures.
    """

    quantity: str
    ours: float | None
    peer: str = ""
    theirs: float | None = None
    unit: str = "ms"
    at_most: float | None = None
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """Ours over theirs; None where there is no peer's figure."""
        return self.ours / self.theirs if self.ours is not None and self.theirs else None

    @property
    def judged(self) -> float | None:
        """What the budget is about: the ratio, or our figure where no peer belongs to it."""
        return self.ratio if self.peer else self.ours

    @property
    def met(self) -> bool | None:
        """Whether the budget is kept; None without a budget or a figure."""
        return None if self.at_most is None or self.judged is None else self.judged <= self.at_most


@dataclass
class Part:
    """The rows of one question, in the order to be read.

    about: what was done, so that it can be repeated.  remarks: what is missing or failed, each a sentence.
    appendix: lines of Markdown that stand after them.
    """

    title: str
    about: str
    rows: list[Row] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    appendix: list[str] = field(default_factory=list)
