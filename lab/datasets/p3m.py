"""Gravity in a periodic box with short-range forces: a particle mesh and, beside it, a sum over near pairs.

Lengths are cells of the particles' lattice, as in gravity.py, whose 2LPT begins the run. The force of a particle is
split by a Gaussian of SPLIT mesh cells: the mesh has what is smooth, with ik gradients and the painter's window taken
out; pairs have the rest, up to REACH times the split, softened as Plummer has it.
"""

import numba
import numpy as np
import scipy.fft
from gravity import factors
from numpy.polynomial import Chebyshev, Polynomial
from scipy.special import erf

FINER = 4  # mesh cells a particle spacing, along an axis
SPLIT = 1.25  # r_s, mesh cells
REACH = 4.5  # where pairs end, r_s
SOFTENING = 1 / 25  # of the particles' spacing
DEGREE = 10  # of the polynomial in r^2 for what the mesh has of a pair's force

RANGE = 2  # cells of pairs that reach one another, along an axis: their edge is half the pairs' reach


def mesh_share():
    """Coefficients, in t = 2 (r / reach)^2 - 1, of the mesh's part of a pair's force over r, times r_s^3."""

    def share(t):
        s = REACH * np.sqrt(np.maximum((t + 1) / 2, 1e-6))
        return (erf(s / 2) - s / np.sqrt(np.pi) * np.exp(-(s**2) / 4)) / s**3

    return Chebyshev.interpolate(share, DEGREE).convert(kind=Polynomial).coef.astype(np.float32)


@numba.njit(fastmath=True, cache=True, error_model="numpy")
def gather(place, start, side, size, column, iz, near):
    """Copy the particles that may reach those of a cell to `near` (3, any), or to a larger one; it, and their number."""
    wide = 2 * RANGE + 1
    count = 0
    for write in range(2):
        if write and count > near.shape[1]:
            near = np.empty((3, 2 * count), np.float32)
        count = 0
        for shift in range(wide**3):
            jx = column // side + shift // wide**2 - RANGE
            jy = column % side + shift // wide % wide - RANGE
            jz = iz + shift % wide - RANGE
            # Images of the periodic box lie a box further.
            wx, wy, wz = jx // side, jy // side, jz // side
            other = ((jx - wx * side) * side + jy - wy * side) * side + jz - wz * side
            if write:
                for j in range(start[other], start[other + 1]):
                    at = count + j - start[other]
                    near[0, at] = place[j, 0] + np.float32(wx * size)
                    near[1, at] = place[j, 1] + np.float32(wy * size)
                    near[2, at] = place[j, 2] + np.float32(wz * size)
            count += start[other + 1] - start[other]
    return near, count


@numba.njit(fastmath=True, cache=True, error_model="numpy")
def pull(near, count, x, y, z, reach2, soft2, c):
    """Sum of the forces of the first `count` of `near` on a particle, times 4 pi."""
    scale, one, zero = np.float32(2.0) / reach2, np.float32(1.0), np.float32(0.0)
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10]
    fx, fy, fz = zero, zero, zero
    for j in range(count):
        dx, dy, dz = near[0, j] - x, near[1, j] - y, near[2, j] - z
        r2 = dx * dx + dy * dy + dz * dz
        t = r2 * scale - one
        mesh = c6 + t * (c7 + t * (c8 + t * (c9 + t * c10)))
        mesh = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * mesh)))))
        d2 = r2 + soft2
        force = one / (d2 * np.sqrt(d2)) - mesh
        force = force if r2 < reach2 else zero
        fx += force * dx
        fy += force * dy
        fz += force * dz
    return fx, fy, fz


@numba.njit(parallel=True, fastmath=True, cache=True, error_model="numpy")
def pairs(place, start, side, size, split, soft, poly, out):
    """Add to `out` (N, 3) the pairs' forces; `place` (N, 3) is sorted by cells of `side`^3, which begin at `start`."""
    reach2, soft2 = np.float32((REACH * split) ** 2), np.float32(soft * soft)
    c, unit = poly * np.float32(1 / split**3), np.float32(1 / (4 * np.pi))
    for column in numba.prange(side * side):
        near = np.empty((3, 4096), np.float32)
        for iz in range(side):
            low, high = start[column * side + iz], start[column * side + iz + 1]
            if low == high:
                continue
            near, count = gather(place, start, side, size, column, iz, near)
            for i in range(low, high):
                fx, fy, fz = pull(near, count, place[i, 0], place[i, 1], place[i, 2], reach2, soft2, c)
                out[i, 0] += unit * fx
                out[i, 1] += unit * fy
                out[i, 2] += unit * fz


@numba.njit(fastmath=True, cache=True, error_model="numpy")
def paint(place, cells, finer):
    """Clouds in cells of unit mass; in one thread, so that sums have one order."""
    grid = np.zeros((cells, cells, cells), np.float32)
    for i in range(len(place)):
        x, y, z = place[i, 0] * finer, place[i, 1] * finer, place[i, 2] * finer
        ix, iy, iz = int(x), int(y), int(z)
        x, y, z = x - ix, y - iy, z - iz
        for corner in range(8):
            a, b, c = corner >> 2, corner >> 1 & 1, corner & 1
            weight = (x if a else 1 - x) * (y if b else 1 - y) * (z if c else 1 - z)
            grid[(ix + a) % cells, (iy + b) % cells, (iz + c) % cells] += np.float32(weight)
    return grid


@numba.njit(parallel=True, fastmath=True, cache=True, error_model="numpy")
def read(grid, place, finer, axis, out):
    """Add to `out[:, axis]` the grid's values at places, by clouds in cells."""
    cells = len(grid)
    for i in numba.prange(len(place)):
        x, y, z = place[i, 0] * finer, place[i, 1] * finer, place[i, 2] * finer
        ix, iy, iz = int(x), int(y), int(z)
        x, y, z = x - ix, y - iy, z - iz
        total = np.float32(0.0)
        for corner in range(8):
            a, b, c = corner >> 2, corner >> 1 & 1, corner & 1
            weight = (x if a else 1 - x) * (y if b else 1 - y) * (z if c else 1 - z)
            total += np.float32(weight) * grid[(ix + a) % cells, (iy + b) % cells, (iz + c) % cells]
        out[i, axis] += total


@numba.njit(parallel=True, fastmath=True, cache=True, error_model="numpy")
def slope(density, k, window, axis, out):
    """The transform of the mesh's force along an axis."""
    cells = len(k)
    for ix in numba.prange(cells):
        for iy in range(cells):
            for iz in range(density.shape[2]):
                k2 = k[ix] ** 2 + k[iy] ** 2 + k[iz] ** 2
                along = k[ix] if axis == 0 else k[iy] if axis == 1 else k[iz]
                value = np.float32(along * window[ix] * window[iy] * window[iz] / k2) if k2 > 0 else np.float32(0.0)
                out[ix, iy, iz] = np.complex64(1j) * density[ix, iy, iz] * value


def forces(place, n, threads):
    """Forces (N, 3) on particles at `place` (N, 3), float32 within [0, n)."""
    cells, split = n * FINER, SPLIT / FINER
    side = int(n / (REACH * split / RANGE))
    at = np.minimum((place * np.float32(side / n)).astype(np.int64), side - 1)
    cell = (at[:, 0] * side + at[:, 1]) * side + at[:, 2]
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(side**3 + 1))
    sorted_place, found = place[order], np.zeros_like(place)
    density = scipy.fft.rfftn(paint(sorted_place, cells, FINER), workers=threads)
    k = 2 * np.pi * np.fft.fftfreq(cells) * FINER
    # Painting and reading each leave the window of a cloud; counts become densities of a lattice's cells.
    window = FINER * np.exp(-((k * split) ** 2)) / np.sinc(np.fft.fftfreq(cells)) ** 4
    change = np.empty_like(density)
    for axis in range(3):
        slope(density, k, window, axis, change)
        read(scipy.fft.irfftn(change, (cells,) * 3, workers=threads), sorted_place, FINER, axis, found)
    pairs(sorted_place, start, side, n, split, SOFTENING, mesh_share(), found)
    back = np.empty_like(found)
    back[order] = found
    return back


def places(lattice, moved, n):
    """Where particles are, within [0, n), in float32."""
    place = np.mod(lattice + moved.astype(np.float64), n).astype(np.float32)
    place[place >= n] = 0
    return place


def advance(state, lattice, n, low, high, threads):
    """One leapfrog step, kick, drift, kick; the force at its end is kept for the next."""
    moved, momentum, force = state
    middle = 0.5 * (low + high)
    momentum = momentum + force * np.float32(factors(low, middle)[1])
    moved = moved + momentum * np.float32(factors(low, high)[0])
    force = forces(places(lattice, moved, n), n, threads)
    return moved, momentum + force * np.float32(factors(middle, high)[1]), force
