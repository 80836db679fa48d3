"""SZ3 and ZFP for the laboratory: answers requests on standard input until it ends.

A request is its length (uint64), then: a letter for its kind ('v' versions, 'c' compress, 'd' decompress), the
length of a compressor's name (uint8) and the name, the bound (float64), the number of particles (uint64), and data:
three float32 columns one after the other, or compressed bytes. An answer is 'K', 'E' (an error) or 'M' (packages
are missing), its length (uint64), and bytes: for 'v' lines "name source", for 'c' the compressed bytes, for 'd' three
columns, for an error its text, for 'M' the packages. All numbers are little-endian.
"""

import os
import struct
import sys

# Import modules only from this Python, not from the current folder.
sys.path = [p for p in sys.path if p not in ("", os.getcwd())]
# Only answers go to standard output; what libraries print goes to standard error.
ANSWERS = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)

MISSING = []
try:
    import numpy as np
except ImportError:
    MISSING.append("numpy")
try:
    import pysz
except ImportError:
    MISSING.append("pysz")
try:
    import zfpy
except ImportError:
    MISSING.append("zfpy")


def version(package):
    from importlib.metadata import version as of

    return of(package)


class SZ3:
    """Absolute bound, each axis alone, by the better of two predictors."""

    @staticmethod
    def source():
        # The library writes the version of its format into its header, after the magic number.
        header = SZ3.compress(np.zeros(16, np.float32), 0.1)[4:8]
        return "SZ3 %d.%d.%d by pysz %s" % (header[3], header[2], header[1], version("pysz"))

    @staticmethod
    def compress(column, bound):
        def by(algorithm):
            config = pysz.szConfig(len(column))
            config.errorBoundMode = pysz.szErrorBoundMode.ABS
            config.absErrorBound = bound
            config.cmprAlgo = algorithm
            return pysz.sz.compress(column, config)[0].tobytes()

        return min(by(pysz.szAlgorithm.INTERP_LORENZO), by(pysz.szAlgorithm.LORENZO_REG), key=len)

    @staticmethod
    def decompress(data, n):
        return pysz.sz.decompress(np.frombuffer(data, np.uint8), np.float32, (n,))[0]


class ZFP:
    """Fixed accuracy, each axis alone."""

    @staticmethod
    def source():
        return "zfp by zfpy %s" % version("zfpy")

    @staticmethod
    def compress(column, bound):
        return zfpy.compress_numpy(column, tolerance=bound)

    @staticmethod
    def decompress(data, n):
        column = zfpy.decompress_numpy(data)
        if column.shape != (n,) or column.dtype != np.float32:
            raise ValueError("the column has another length")
        return column


COMPRESSORS = {"SZ3": SZ3, "ZFP": ZFP}


def compress(compressor, bound, n, data):
    columns = np.frombuffer(data, np.float32).reshape(3, n)
    # The libraries refuse empty columns.
    parts = [compressor.compress(np.ascontiguousarray(c), bound) if n else b"" for c in columns]
    return b"".join([struct.pack("<4Q", n, *map(len, parts)), *parts])


def decompress(compressor, data):
    n, *lengths = struct.unpack_from("<4Q", data)
    if len(data) != 32 + sum(lengths):
        raise ValueError("the lengths do not add up")
    at, columns = 32, []
    for length in lengths:
        part = data[at : at + length]
        at += length
        columns.append(np.ascontiguousarray(compressor.decompress(part, n), dtype=np.float32).tobytes() if n else b"")
    return b"".join(columns)


def answer(request):
    if MISSING:
        raise ImportError(" ".join(MISSING))
    what, length = struct.unpack_from("<cB", request)
    name = request[2 : 2 + length].decode()
    bound, n = struct.unpack_from("<dQ", request, 2 + length)
    data = request[2 + length + 16 :]
    if what == b"v":
        return "\n".join("%s %s" % (k, c.source()) for k, c in COMPRESSORS.items()).encode()
    if what == b"c":
        return compress(COMPRESSORS[name], bound, n, data)
    return decompress(COMPRESSORS[name], data)


def read(n):
    """Reads n bytes from standard input; exits at its end."""
    data = sys.stdin.buffer.read(n)
    if len(data) < n:
        sys.exit(0)
    return data


while True:
    request = read(struct.unpack("<Q", read(8))[0])
    try:
        status, data = b"K", answer(request)
    except ImportError as error:
        status, data = b"M", str(error).encode()
    except Exception as error:
        status, data = b"E", ("%s: %s" % (type(error).__name__, error)).encode()
    ANSWERS.write(status + struct.pack("<Q", len(data)))
    ANSWERS.write(data)
    ANSWERS.flush()
