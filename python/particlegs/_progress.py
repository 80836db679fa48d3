"""A progress bar."""

from __future__ import annotations


class Bar:
    """A bar of tqdm's for the phase that is on, told of by (phase, done, total)."""

    def __init__(self):
        from tqdm.auto import tqdm

        self._tqdm = tqdm
        self._bar = None
        self._phase = None

    def __call__(self, phase, done, total):
        if phase != self._phase or self._bar is None:
            self.close()
            self._bar = self._tqdm(total=total or None, desc=phase, unit="", leave=False, dynamic_ncols=True)
            self._phase = phase
        self._bar.update(done - self._bar.n)
        if total and done >= total:
            self.close()

    def close(self):
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
        self._bar = None
        self._phase = None
