"""Run pytest as another processor would compute: with other kernels of OpenBLAS, NumPy and the C library.

    python tools/other_processor.py tests/test_identify_search.py

Each of the three picks its code by what the processor can do, and the last bits of a sum or of a sine differ with it.
OpenBLAS has a kernel for AVX-512, one for AVX2 and FMA (Haswell; AMD's Zen has the same) and one for neither (Nehalem):
taken is the next smaller one than this processor's. NumPy and the C library do without all that is not in every x86-64.
"""

import os
import sys

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__


def environment() -> dict[str, str]:
    """The variables that a process needs before it loads NumPy."""
    return {
        "OPENBLAS_CORETYPE": "Haswell" if __cpu_features__.get("AVX512_SKX") else "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": " ".join(name for name in __cpu_dispatch__ if __cpu_features__[name]),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4",
    }


if __name__ == "__main__":
    changed = environment()
    print(*(f"{name}={value!r}" for name, value in changed.items()), flush=True)
    os.execve(sys.executable, [sys.executable, "-m", "pytest", *sys.argv[1:]], os.environ | changed)
