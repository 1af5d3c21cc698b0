"""Exported C, built with this machine's compiler, and stepped over rows of numbers."""

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.export.files import FLAGS, files, results_of
from bowden.export.unit import Module, Unit, is_number, numbers

COMPILER = shutil.which("cc")
Array = NDArray[np.float64]

DRIVER = """
#include "{prefix}.h"
void drive(const double *in, long count, double *out);
void drive(const double *in, long count, double *out)
{{
{declared}
    for (long k = 0; k < count; ++k) {{
        const bool anew = *in++ != 0.0;
{read}
        if (anew) {{
{begin}
        }}
        {call};
{written}
    }}
}}
"""


def bits(values: Any) -> NDArray[np.int64]:
    """Bit patterns, every NaN with the same one."""
    array = np.array(values, dtype=np.float64)
    array[np.isnan(array)] = np.nan
    return array.view(np.int64)


def write(module: Module, folder: Path, *, single: bool = False) -> dict[str, str]:
    """Both files of a module, written."""
    texts = files(module, "for a test", single=single)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return texts


class Exported:
    """A function with a state, of a module.

    Args:
        module: the module.
        name: of the function.
        begin: C that sets ``state`` of the arguments.
        folder: for the code.
        single: in float.
    """

    def __init__(self, module: Module, name: str, begin: str, folder: Path, *, single: bool = False) -> None:
        write(module, folder, single=single)
        unit = Unit(module, single=single)
        (kernel, results), (_, kinds, _) = module.functions[name], results_of(unit, name)
        names = results.split()
        given = [pair for pair in module.arguments(kernel).items() if pair[0] not in module.constants]
        results = [
            (f"got_{called}" if called != "state" else called, kind) for called, kind in zip(names, kinds, strict=True)
        ]
        declared = {called: unit.type(kind) for called, kind in (*given, *results)}
        read, written = [], []
        for called, kind in given:
            for way, one in numbers(kind, called) if called != "state" else ():
                read.append(f"        {way} = ({unit.type(one)})*in++;")
        for called, kind in results:
            written += [f"        *out++ = (double){way};" for way, _ in numbers(kind, called)]
        self.width = len(written)
        texts = [called if is_number(kind) else f"&{called}" for called, kind in given if called != "state"]
        outs = [f"&got_{called}" for called in names if called not in ("state", "return")]
        states = ["&state"] if "state" in names else []
        call = f"{module.prefix}_{name}({', '.join([*states, *texts, *outs])})"
        if "return" in names:
            call = f"got_return = {call}"
        text = DRIVER.format(
            prefix=module.prefix,
            declared="\n".join(f"    static {kind} {called};" for called, kind in declared.items()),
            read="\n".join(read),
            begin=f"            {begin};",
            call=call,
            written="\n".join(written),
        )
        (folder / "driver.c").write_text(text)
        library = folder / f"{module.prefix}.so"
        command = [str(COMPILER), *FLAGS.split(), "-fPIC", "-shared", f"{module.prefix}.c", "driver.c"]
        subprocess.run([*command, "-o", str(library), "-lm"], cwd=folder, check=True)
        self.drive = ctypes.CDLL(str(library)).drive
        self.drive.argtypes, self.drive.restype = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p], None

    def over(self, rows: Array) -> Array:
        """Results (n, m) in the function's order, of rows (n, 1 + k): whether to begin anew, then the arguments."""
        rows, out = np.ascontiguousarray(rows, dtype=np.float64), np.empty((len(rows), self.width))
        self.drive(rows.ctypes.data, len(rows), out.ctypes.data)
        return out
