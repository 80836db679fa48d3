"""Compression."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

from numpy.typing import ArrayLike

from . import _coerce, _open, _particlegs
from ._model import Model
from ._particlegs import InputError
from ._series import Series
from ._snapshot import Snapshot, as_snapshot
from ._types import CertificateLevel, Effort, Law, Path, Progress, Sharing, Training


def compress(
    snapshot: Union[Snapshot, ArrayLike],
    *,
    ratio: Optional[float] = None,
    size: Union[int, str, None] = None,
    size_total: Union[int, str, None] = None,
    gaussians: Optional[int] = None,
    psnr: Optional[float] = None,
    max_pk_error: Union[float, str, None] = None,
    k_max: Optional[float] = None,
    min_correlation: Optional[float] = None,
    cell: Optional[float] = None,
    groups_within: Union[float, str, None] = None,
    from_size: Optional[int] = None,
    effort: Effort = "default",
    radius: Optional[float] = None,
    opacity: Optional[float] = None,
    train: Optional[Training] = None,
    law: Optional[Law] = None,
    certificate: CertificateLevel = "quick",
    memory: Union[int, str, None] = None,
    blocks: Optional[int] = None,
    share_gaussians: Sharing = "auto",
    scratch: Optional[Path] = None,
    fields: Union[Mapping[str, Any], str, Sequence[str], None] = None,
    output: Optional[Path] = None,
    overwrite: bool = False,
    resume: bool = False,
    box: Any = None,
    seed: int = 42,
    threads: Optional[int] = None,
    progress: Progress = None,
) -> Model:
    """Compresses particles to a model. The command makes the same file, byte for byte, from the same options.

    Parameters
    ----------
    snapshot : Snapshot or array_like, shape (n, 3)
        The particles.
    ratio : float, optional
        Raw bytes of the particles (12 each, 16 with weights) / bytes of the file. Give at most one target. The default
        is 300; for files below 250 kB it drops to 100, and further below about 85 000 particles.
    size : int or str, optional
        Size of the file, such as ``"11MB"``.
    size_total : int or str, optional
        Size of the file with its `fields`. Up to six fits are made, until the file has 98 % of it, but no more.
    gaussians : int, optional
        Number of Gaussians.
    psnr : float, optional
        Masked PSNR to reach, dB. This and the next three targets take up to eight fits.
    max_pk_error, k_max : float or str, float
        Largest error of P(k), such as ``"1%"``, up to the wave number `k_max`.
    min_correlation, cell : float, float
        Correlation of the densities in cells with edge `cell`.
    groups_within, from_size : float or str, int
        Largest error of the number of groups, for groups of at least `from_size` particles.
    effort : {"default", "fast", "best"}
        Time spent on the fit.
    radius, opacity : float, optional
        Particle radius (world units) and opacity to store as the defaults.
    train : {"fast", "best", "paper"}, optional
        Train on pictures of the particles.
    law : {"optical-depth", "alpha-blend"}, optional
        The image law to train for.
    certificate : {"none", "quick", "full"}
        How much to measure of the decoded model; the results are stored in the file.
    memory : int or str, optional
        Memory limit, such as ``"2GiB"``; larger snapshots are fitted block by block.
    blocks : int, optional
        Number of blocks.
    share_gaussians : {"auto", "yes", "no"}
        Whether particle types share Gaussians: by default where that describes them better. Types with fields do not.
    scratch : path, optional
        Folder for the scratch files of `memory`.
    fields : dict of array_like, or str or several, optional
        Fields to store as well. For a snapshot from files their names, such as ``["velocity"]`` or ``"all"``; otherwise
        arrays by name: shape (n,) for a scalar, (n, 3) for a vector. Arrays with units keep them. All targets but
        `size_total` are met without the fields.
    output : path, optional
        Write the model to this file. Training keeps a checkpoint beside it, ``OUTPUT.checkpoint``, until it is done. A
        file that was made from the same snapshot with the same options is kept.
    overwrite : bool
        Replace another model, and the checkpoint of an interrupted run.
    resume : bool
        Continue an interrupted run from its checkpoint.
    box : optional
        As for `Snapshot`; only if `snapshot` is an array of positions.
    seed : int
        The same input, options and seed give the same bytes for any number of threads.
    threads : int, optional
        Number of threads; all that the process may use by default.
    progress : bool or callable, optional
        True for a progress bar, or a function of (phase, done, total). If it raises an exception, the work stops.

    Returns
    -------
    Model

    Raises
    ------
    UnreachableError
        If the target cannot be reached.
    MemoryError
        If there is too little memory; checked before it is allocated.
    KeyboardInterrupt
        On Ctrl-C, within half a second. Only the checkpoint of a training with `output` is left behind.

    Warns
    -----
    UserWarning
        For the command's notes, such as a missing periodic box, particles outside the box, or a file smaller than
        requested.
    """
    names, arrays = (None, fields) if isinstance(fields, Mapping) else (fields, None)
    asked = _options(
        ratio=ratio,
        size=size,
        size_total=size_total,
        gaussians=gaussians,
        psnr=psnr,
        max_pk_error=max_pk_error,
        k_max=k_max,
        min_correlation=min_correlation,
        cell=cell,
        groups_within=groups_within,
        from_size=from_size,
        effort=effort,
        radius=radius,
        opacity=opacity,
        train=train,
        law=law,
        certificate=certificate,
        memory=memory,
        blocks=blocks,
        share_gaussians=share_gaussians,
        fields=names,
        seed=seed,
    )
    if resume and output is None:
        raise InputError("resume=True needs output=, whose checkpoint is continued")
    if box is not None and isinstance(snapshot, Snapshot):
        raise InputError("a Snapshot has its own box: give box= to Snapshot or open instead")
    particles = as_snapshot(snapshot, box=box)
    folder = os.fspath(scratch) if scratch is not None else (tempfile.gettempdir() if memory is not None else None)
    own = [(name, *_coerce.field(values, name)) for name, values in (arrays or {}).items()]
    target = {
        "output": None if output is None else os.fspath(output),
        "overwrite": overwrite,
        "resume": resume,
        "scratch": folder,
    }
    native = _particlegs.compress(particles._native, asked, target, own, threads, _coerce.progress(progress))
    return Model._of(native)


def compress_series(
    snapshots: Union[Path, Sequence[Path]],
    path: Path,
    *,
    frames: Optional[str] = None,
    keyframe_interval: int = 16,
    align: Optional[str] = None,
    overwrite: bool = False,
    read: Optional[Mapping[str, Any]] = None,
    threads: Optional[int] = None,
    progress: Progress = None,
    **options: Any,
) -> Series:
    """Makes a series of models of the snapshots of a run. The command ``particlegs series`` makes the same file.

    Called again, it goes on after an interruption, or adds further snapshots.

    Parameters
    ----------
    snapshots : path or several
        Snapshots, their folder, or a trajectory, with `frames`. Snapshots are sorted by their times.
    path : path
        The file of the series.
    frames : str, optional
        Frames of a trajectory, ``"FIRST:END:STEP"``: from FIRST to before END, every STEP.
    keyframe_interval : int
        Frames from one keyframe to the next.
    align : str, optional
        Atoms, such as ``"name CA"``, by which each frame is turned and moved onto the first. Aligned frames have no
        periodic box.
    overwrite : bool
        Replace a series that was made with other options, or of other snapshots.
    read : dict, optional
        Options of `open`, such as ``{"species": "dm"}``.
    threads, progress : optional
        As for `compress`.
    **options
        Options of `compress`: a target, `effort`, `certificate`, `memory`, `blocks`, `seed`, and `fields` by name.
        A `certificate` that is given is measured of every frame; without it, keyframes alone get the quick one.

    Returns
    -------
    Series

    Warns
    -----
    UserWarning
        For a snapshot that cannot be read, which is missing in the series, and the command's notes.

    Examples
    --------
    >>> run = pg.compress_series("output/snap_*.hdf5", "run.pgs", ratio=300, fields="velocity")  # doctest: +SKIP
    """
    made = {
        "keyframe_interval": keyframe_interval,
        "certify_changes": "certificate" in options,
        "frames": frames,
        "align": align,
        "overwrite": overwrite,
    }
    _particlegs.make_series(
        _coerce.paths(snapshots),
        os.fspath(path),
        _open.options(**(read or {})),
        _options(**options),
        made,
        threads,
        _coerce.progress(progress),
    )
    return Series(path, threads=threads)


def _options(
    *,
    ratio: Optional[float] = None,
    size: Union[int, str, None] = None,
    size_total: Union[int, str, None] = None,
    gaussians: Optional[int] = None,
    psnr: Optional[float] = None,
    max_pk_error: Union[float, str, None] = None,
    k_max: Optional[float] = None,
    min_correlation: Optional[float] = None,
    cell: Optional[float] = None,
    groups_within: Union[float, str, None] = None,
    from_size: Optional[int] = None,
    effort: Effort = "default",
    radius: Optional[float] = None,
    opacity: Optional[float] = None,
    train: Optional[Training] = None,
    law: Optional[Law] = None,
    certificate: CertificateLevel = "quick",
    memory: Union[int, str, None] = None,
    blocks: Optional[int] = None,
    share_gaussians: Sharing = "auto",
    fields: Union[str, Sequence[str], None] = None,
    seed: int = 42,
) -> dict[str, Any]:
    """The options of a compression as the native module takes them; `fields` are names of fields of the files."""
    if size is not None and size_total is not None:
        raise InputError("only one target can be met: size or size_total")
    goals: list[tuple[str, Union[float, str, None], str, Optional[float]]] = [
        ("max_pk_error", max_pk_error, "k_max", k_max),
        ("min_correlation", min_correlation, "cell", cell),
        ("groups_within", groups_within, "from_size", from_size),
    ]
    goal = None
    for name, asked, beside, at in goals:
        if (asked is None) != (at is None):
            raise InputError(f"{name} and {beside} must be given together")
        if asked is not None and at is not None:
            if goal is not None:
                raise InputError(f"only one target can be met: {goal[0]} or {name}")
            goal = (name, _coerce.share(asked), float(at))
    return {
        "ratio": ratio,
        "size": _coerce.bytes_of(size if size_total is None else size_total),
        "gaussians": gaussians,
        "psnr": psnr,
        "goal": goal,
        "effort": effort,
        "radius": radius,
        "opacity": opacity,
        "train": train,
        "law": law,
        "certificate": certificate,
        "memory": _coerce.bytes_of(memory),
        "blocks": blocks,
        "share_gaussians": share_gaussians,
        "fields": _coerce.texts(fields),
        "size_with_fields": size_total is not None,
        "seed": seed,
    }
