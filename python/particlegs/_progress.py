"""Progress: a tqdm bar if tqdm is installed, otherwise plain text."""

from __future__ import annotations

import sys
from typing import Any, Callable, Optional


def shown() -> Callable[[str, int, int], object]:
    """A function of (phase, done, total) that shows progress."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return Text()
    return Bar(tqdm)


class Text:
    """Text on standard error: the current phase and percentage on a terminal, otherwise a line per phase."""

    def __init__(self) -> None:
        self._last = ""

    def __call__(self, phase: str, done: int, total: int) -> None:
        terminal = sys.stderr.isatty()
        share = f" {100 * done // total} %" if terminal and total else ""
        if phase + share == self._last:
            return
        self._last = phase + share
        sys.stderr.write(f"\r\x1b[K{self._last}" if terminal else f"{phase}\n")
        if terminal and total and done >= total:
            sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()


class Bar:
    """A tqdm bar for the current phase."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._phase: Optional[str] = None

    def __call__(self, phase: str, done: int, total: int) -> None:
        if phase != self._phase or self._bar is None:
            self.close()
            self._bar = self._tqdm(total=total or None, desc=phase, unit="", leave=False, dynamic_ncols=True)
            self._phase = phase
        self._bar.update(done - self._bar.n)
        if total and done >= total:
            self.close()

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
        self._bar = None
        self._phase = None
