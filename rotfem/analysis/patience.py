"""How long something that has failed is left alone."""

from __future__ import annotations

#: Failures in a row after which the time that passes before the next attempt grows no more.
MOST = 5


class Patience:
    """Attempts at something that pays where it works: after k failures in a row 2^k chances pass without one."""

    def __init__(self) -> None:
        self._failures = self._passing = 0

    def over(self) -> bool:
        """Return whether it may be tried now; otherwise this chance has passed."""
        if self._passing == 0:
            return True
        self._passing -= 1
        return False

    def failed(self) -> None:
        """Take note of a failure: the chance that it was counts as the first of those that pass."""
        self._failures = min(self._failures + 1, MOST)
        self._passing = 2**self._failures - 1

    def worked(self) -> None:
        """Take note of a success."""
        self._failures = 0
