"""yt: data sets of particles and of grids."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._particlegs import InputError
from .._units import text_of
from ._common import SKY, above_and_below, mass_of_each, needed, right_box, size_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._arrays import Grid
    from .._snapshot import Snapshot
    from .._types import Known


def from_yt(
    cls: type[Snapshot],
    /,
    data: Any,
    particle_type: Optional[str] = None,
    **known: Unpack[Known],
) -> Snapshot:
    """Converts particles of yt: positions, masses, types, box, scale factor and h.

    Parameters
    ----------
    data : yt.data_objects.static_output.Dataset, or a data container
        The result of ``yt.load``, or a part of it such as a region or a sphere.
    particle_type : str, optional
        By default all types in the file, each as a layer; see ``ds.particle_types_raw``.
    **known
        As for `Snapshot`; these override values of the data set. ``masses=None`` gives all particles the same mass.
        Positions are converted to `units`: by default comoving Mpc/h for a cosmological data set, otherwise a unit
        that suits the size of the domain.

    Returns
    -------
    Snapshot
    """
    unyt = needed("unyt")
    ds = data if hasattr(data, "all_data") else data.ds
    particles = data.all_data() if hasattr(data, "all_data") else data
    kinds = [particle_type] if particle_type else list(ds.particle_types_raw)
    lacking = [kind for kind in kinds if (kind, "particle_position") not in ds.derived_field_list]
    if particle_type and lacking:
        there = ", ".join(sorted(ds.particle_types))
        raise InputError(f'there are no particles of the type "{particle_type}": the types are {there}')
    kinds = [kind for kind in kinds if kind not in lacking]
    positions = {kind: particles[kind, "particle_position"] for kind in kinds}
    kinds = [kind for kind in kinds if len(positions[kind])]
    if not kinds:
        raise InputError("there are no particles")
    cosmological = bool(ds.cosmological_simulation)
    unit = known.get("units") or (
        "Mpccm/h" if cosmological else ds.get_smallest_appropriate_unit(ds.domain_width.max())
    )
    said: dict[str, Any] = {
        "box": ds.domain_width.to_value(unit),
        "pbc": [bool(p) for p in ds.periodicity],
        "origin": ds.domain_left_edge.to_value(unit),
        "name": str(ds),
        "time": float(ds.current_time.to_value("Myr")),
    }
    if cosmological:
        said.update(
            scale_factor=1.0 / (1.0 + ds.current_redshift), hubble=float(ds.hubble_constant), comoving="cm" in unit
        )
    if all((kind, "particle_mass") in ds.derived_field_list for kind in kinds):
        said["masses"] = unyt.unyt_array(
            np.concatenate([particles[kind, "particle_mass"].to_value("Msun") for kind in kinds]), "Msun"
        )
    if len(kinds) > 1:
        said["layers"] = {kind: len(positions[kind]) for kind in kinds}
    said = {**said, **known, "units": text_of(unit)}
    return cls(np.concatenate([positions[kind].to_value(unit) for kind in kinds]), **said)


def to_yt(snapshot: Snapshot, *, hubble: Optional[float] = None, **options: Any) -> Any:
    """Converts the particles to yt.

    Parameters
    ----------
    hubble : float, optional
        Value of h for units such as ``Mpc/h``; the snapshot's by default.
    **options
        For ``yt.load_particles``; these override values of the snapshot: ``length_unit``, ``mass_unit``, ``bbox``, ...

    Returns
    -------
    yt.frontends.stream.data_structures.StreamParticlesDataset
        Particles of type ``io`` with ``particle_mass`` (1 if masses are unknown). The data set is not cosmological, so
        comoving lengths stay comoving. Positions without a unit are taken to be in cm, as always in yt.

    Raises
    ------
    InputError
        If the box is tilted or yt does not know a unit.
    """
    yt = needed("yt")
    positions, each = np.asarray(snapshot.positions, dtype=np.float64), mass_of_each(snapshot)
    data = {("io", f"particle_position_{axis}"): positions[:, k].copy() for k, axis in enumerate("xyz")}
    data["io", "particle_mass"] = np.ones(len(snapshot)) if each is None else np.array(each)
    h = snapshot.metadata["hubble"] if hubble is None else hubble
    said: dict[str, Any] = {"dataset_name": snapshot.name}
    for dimension, unit in (("length", snapshot.length_unit), ("mass", snapshot.mass_unit)):
        if unit is not None and f"{dimension}_unit" not in options:
            said[f"{dimension}_unit"] = size_of(unit, dimension, h, SKY, "yt")
    box, origin = right_box(snapshot, "yt"), snapshot.origin
    if box is not None and origin is not None:
        inside = (positions >= origin) & (positions < origin + box)
        if not inside.all():
            for k, axis in enumerate("xyz"):
                at = origin[k] + np.mod(positions[:, k] - origin[k], box[k])
                data["io", f"particle_position_{axis}"] = at if snapshot.periodic[k] else positions[:, k].copy()
        said.update(bbox=np.stack([origin, origin + box], axis=1), periodicity=snapshot.periodic)
    else:
        low, high = snapshot.bounds
        margin = 1e-6 * np.maximum(high - low, np.max(high - low) * 1e-3 + 1e-300)
        said.update(bbox=np.stack([low - margin, high + margin], axis=1), periodicity=(False, False, False))
    return yt.load_particles(data, **{**said, **options})


def grid_to_yt(grid: Grid, **options: Any) -> Any:
    """Converts the density to yt.

    Parameters
    ----------
    **options
        For ``yt.load_uniform_grid``; these override values of the grid: ``length_unit``, ``periodicity``, ...

    Returns
    -------
    yt.frontends.stream.data_structures.StreamDataset
        With the field ``("stream", "density")``, or ``("stream", "number_density")`` if masses are unknown. Comoving
        lengths stay comoving; lengths without a unit are taken to be in cm, as always in yt.

    Raises
    ------
    InputError
        If yt does not know a unit, or a unit contains h and its value is unknown.
    """
    if grid.field is not None:
        raise InputError(f"only densities are converted to yt, not the field {grid.field}")
    yt = needed("yt")
    above = above_and_below(grid.unit)[0]
    field, mass = ("number_density", "1") if above == "particles" else ("density", "code_mass")
    said: dict[str, Any] = {"dataset_name": "density", "periodicity": grid.periodic}
    if grid.length_unit is not None:
        said["length_unit"] = size_of(grid.length_unit, "length", grid.hubble, SKY, "yt")
    if above not in ("particles", "mass"):
        said["mass_unit"] = size_of(above, "mass", grid.hubble, SKY, "yt")
    low = np.asarray(grid.origin)
    high = low + np.asarray(grid.spacing) * grid.shape
    # Masses are in code_mass, so that yt's own conversions work.
    data = {field: (np.array(grid, subok=False), f"{mass}/code_length**3")}
    said["bbox"] = np.stack([low, high], axis=1)
    return yt.load_uniform_grid(data, np.array(grid.shape), **{**said, **options})
