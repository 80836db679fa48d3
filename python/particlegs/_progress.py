"""A progress bar."""

from __future__ import annotations

from typing import Any, Optional


class Bar:
    """A bar of tqdm's for the phase that is on, told of by (phase, done, total)."""

    def __init__(self) -> None:
        from tqdm.auto import tqdm

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
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
        self._bar = None
        self._phase = None
