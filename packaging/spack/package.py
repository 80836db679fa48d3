# For Spack 1.0 and newer: `scripts/release.sh` fills in version and hash.
from spack_repo.builtin.build_systems.cargo import CargoPackage

from spack.package import *


class Particlegs(CargoPackage):
    """Particle snapshots as small files that draw the picture ParaView would draw."""

    homepage = "https://github.com/particlegs/particlegs"
    url = "https://github.com/particlegs/particlegs/releases/download/v0.1.0/particlegs-0.1.0-source.tar.xz"

    license("MIT OR Apache-2.0", checked_by="particlegs")

    version("@VERSION@", sha256="@SHA256@")

    variant("lab", default=False, description="The command bench: models beside other compressors")
    variant("gpu", default=True, description="Pictures and training on GPUs, by Vulkan")

    depends_on("rust@1.89:", type="build")
    # What rustc links by.
    depends_on("c", type="build")

    # The archive holds all dependencies: nothing is fetched.
    build_directory = "crates/particlegs-cli"

    @property
    def build_args(self):
        features = [name for name in ("lab", "gpu") if self.spec.satisfies(f"+{name}")]
        return ["--offline", "--locked", "--no-track", "--profile", "dist", "--features", ",".join(features)]

    def check(self):
        # Tests build everything once more: the command itself is tried.
        Executable(self.prefix.bin.particlegs)("info", join_path(self.stage.source_path, "samples", "nbody64"))
