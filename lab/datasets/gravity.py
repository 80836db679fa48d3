"""A cosmological box by JaxPM's 2LPT, painters and force kernels, and a leapfrog of ours.

Lengths within are cells of the particles' lattice (box / n), momenta a^2 dx/dt / H0. Positions come out as
float64 in Mpc/h. All arrays are float32, as JAX has them by default, on the CPU.
"""

import os

os.environ["JAX_PLATFORMS"] = "cpu"

import jax
import jax.numpy as jnp
import jax_cosmo as jc
import numpy as np
from jaxpm.kernels import gradient_kernel, invlaplace_kernel
# JaxPM's public painters want as many particles as cells; a finer mesh needs what is beneath them.
from jaxpm.painting import _cic_paint_impl as paint
from jaxpm.painting import _cic_read_impl as read
from jaxpm.pm import linear_field, lpt

COSMOLOGY = {"Omega_m": 0.31, "Omega_b": 0.049, "Omega_L": 0.69, "sigma8": 0.81, "n_s": 0.967, "h": 0.68}
FINER = 2  # mesh cells a particle spacing, along an axis
START = 0.03  # scale factor of the initial conditions


def cosmology():
    """The flat cosmology of nbody128, as jax-cosmo has it (radiation left out)."""
    c = COSMOLOGY
    return jc.Cosmology(
        Omega_c=c["Omega_m"] - c["Omega_b"], Omega_b=c["Omega_b"], h=c["h"], n_s=c["n_s"],
        sigma8=c["sigma8"], Omega_k=0.0, w0=-1.0, wa=0.0,
    )


def scale_factors(end):
    """Scale factors of the steps: da = min(0.12 a, 0.018), from START to `end`."""
    steps = [START]
    while steps[-1] < end * (1 - 1e-9):
        steps.append(min(steps[-1] + min(0.12 * steps[-1], 0.018), end))
    return np.array(steps)


def factors(low, high):
    """Drift and kick from one scale factor to another: the integrals of 1/(a^3 E) and 1.5 Omega_m/(a^2 E)."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    a = 0.5 * (high - low) * nodes + 0.5 * (high + low)
    share = 0.5 * (high - low) * weights
    hubble = np.sqrt(COSMOLOGY["Omega_m"] / a**3 + 1 - COSMOLOGY["Omega_m"])
    return np.sum(share / (a**3 * hubble)), np.sum(share * 1.5 * COSMOLOGY["Omega_m"] / (a**2 * hubble))


def initial(n, box, seed):
    """Displacements and momenta (n, n, n, 3) of 2LPT at START; spectrum of Eisenstein and Hu without wiggles."""
    k = jnp.logspace(-4, 3, 1024)
    table = jc.power.linear_matter_power(
        cosmology(), k, transfer_fn=lambda c, q: jc.transfer.Eisenstein_Hu(c, q, type="eisenhu"))
    spectrum = lambda q: jnp.interp(q.reshape(-1), k, table).reshape(q.shape)
    field = linear_field((n,) * 3, (box,) * 3, spectrum, jax.random.PRNGKey(seed))
    # Another cosmology: jax-cosmo keeps its own growth tables in the first, which JaxPM's would be taken for.
    moved, momentum, _ = lpt(cosmology(), field, a=START, order=2)
    return moved, momentum


def waves(cells):
    """Wave numbers a cell along x, y, z, shaped for a real transform (JaxPM's transforms are complex, and slower)."""
    whole, half = 2 * np.pi * np.fft.fftfreq(cells), 2 * np.pi * np.fft.rfftfreq(cells)
    shapes = (whole, (-1, 1, 1)), (whole, (1, -1, 1)), (half, (1, 1, -1))
    return [jnp.asarray(wave, jnp.float32).reshape(shape) for wave, shape in shapes]


def forces(lattice, moved):
    """Forces (N, 3) on particles at `lattice + moved`, on a mesh FINER times as fine as the lattice."""
    n = round(lattice.shape[0] ** (1 / 3))
    cells = n * FINER
    place = (lattice + moved) * FINER
    density = paint(jnp.zeros((cells,) * 3, jnp.float32), place) * FINER**3
    k = waves(cells)
    potential = jnp.fft.rfftn(density) * invlaplace_kernel(k)
    along = [read(jnp.fft.irfftn(-gradient_kernel(k, axis) * potential, density.shape), place) for axis in range(3)]
    return jnp.stack(along, axis=-1) / FINER


@jax.jit
def step(state, lattice, kicks, drift):
    """One leapfrog step, kick, drift, kick; the force at its end is kept for the next."""
    moved, momentum, force = state
    momentum = momentum + force * kicks[0]
    moved = moved + momentum * drift
    force = forces(lattice, moved)
    return moved, momentum + force * kicks[1], force


def simulate(n, box, seed, redshift):
    """Positions (n^3, 3) in Mpc/h, within [0, box), and peculiar velocities in km/s, in the lattice's order; and the
    number of steps.
    """
    moved, momentum = (jnp.asarray(part, jnp.float32).reshape(-1, 3) for part in initial(n, box, seed))
    lattice = jnp.stack(jnp.meshgrid(*[jnp.arange(n, dtype=jnp.float32)] * 3, indexing="ij"), -1).reshape(-1, 3)
    times = scale_factors(1 / (1 + redshift))
    state = moved, momentum, jax.jit(forces)(lattice, moved)
    for low, high in zip(times, times[1:]):
        middle = 0.5 * (low + high)
        kicks = jnp.array([factors(low, middle)[1], factors(middle, high)[1]], jnp.float32)
        state = step(state, lattice, kicks, jnp.float32(factors(low, high)[0]))
    cells = np.asarray(lattice, np.float64) + np.asarray(state[0], np.float64)
    positions = np.mod(cells * (box / n), box)
    # a dx/dt, with H0 = 100 km/s a Mpc/h.
    velocities = np.asarray(state[1], np.float64) * (100 * box / n / times[-1])
    return within(positions, box), velocities, len(times) - 1


def within(positions, box):
    """Positions that round to `box` in float32 go round to 0."""
    return np.where(positions.astype(np.float32) >= np.float32(box), 0.0, positions)
