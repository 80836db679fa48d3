"""What try-wheel.sh asks of the package in an environment: a model of the sample with the command's bytes, and a picture."""

import platform
from pathlib import Path

import numpy as np
import particlegs as pg

model = pg.compress(pg.open("nbody64"), effort="fast")
model.save("package.pgs")
if Path("package.pgs").read_bytes() != Path("command.pgs").read_bytes():
    raise SystemExit("the package's model of the sample is not the command's")
picture = pg.read("package.pgs").render(azimuth=30, elevation=20, size=(320, 180))
if picture.shape != (180, 320) or picture.dtype != np.uint8 or not 0 < picture.mean() < 255:
    raise SystemExit(f"no picture: {picture.shape}, {picture.dtype}, mean {picture.mean()}")
print(f"Python {platform.python_version()}, NumPy {np.__version__}, particlegs {pg.__version__}: the command's bytes")
