"""Compiled kernels that are kept as machine code and called without Numba.

To import Numba and to let it know all that kept code may call takes three quarters of a second; to load a piece of
machine code that calls nothing but libm, a hundredth. So what is called from Python a few times in a command (a loop
over a whole run, a sweep) is kept with how to call it, and Numba is imported only where something is to be compiled.

This is for kernels that take numbers, arrays and nested tuples of these, give back a number or nothing, and ask for no
memory; of any other, `kept_form` gives None. Numba hands a kernel the address for its result, the
address for what is raised, and then every number of its arguments, one by one; an array is seven and more numbers.
That this is so is looked up in what was compiled before it is kept; and what machine code calls is read from the code
itself, where an instruction that a processor does not have has become a call too.
"""

import ctypes
import hashlib
import importlib.util
import json
import math
import os
import pickle
import re
import struct
import threading
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.kernel_content import content_of_class

_WHOLE: dict[str, Any] = {"d": ctypes.c_double, "q": ctypes.c_int64, "b": ctypes.c_bool, "p": ctypes.c_void_p}
"""How a number is handed over: a real one, a whole one, a truth value, an address."""

_GIVEN_BACK = {"float64": "d", "int64": "q", "none": ""}
"""What a kernel may give back, as Numba calls it."""

_AS_LLVM_HAS_IT = {"double": "d", "i64": "q", "i8": "b", "ptr": "p"}

_LIBM = frozenset(dir(math)) | {"cbrt", "exp2", "fabs", "fmax", "fmin", "nearbyint", "rint", "round", "sincos"}
_MEMORY = {"memcpy", "memmove", "memset"}

_NEVER_CALLED = "NRT_MemInfo_call_dtor"
"""What Numba calls where an array that a kernel was given is nobody's any more; what is handed over has no owner."""

_MAY_BE_CALLED = _LIBM | _MEMORY | {_NEVER_CALLED}

_WHAT_IS_RAISED = re.compile(r"^@\.const\.picklebuf\.\w+ = .*?(ptr \w+, i32 \d+) \}", re.MULTILINE)

_DIGEST = hashlib.sha256().digest_size


class _ForeignError(Exception):
    """An argument that only Numba knows how to hand over."""


def flattened(arguments: Iterable[Any]) -> tuple[str, str, list[Any]] | None:
    """What arguments are and how they are handed over.

    Returns:
        A text with their types; a letter of `_WHOLE` for each number; the numbers. None where one is something
        that only Numba knows.
    """
    said: list[str] = []
    letters: list[str] = []
    numbers: list[Any] = []
    try:
        for argument in arguments:
            _flatten(argument, said, letters, numbers)
    except _ForeignError:
        return None
    return " ".join(said), "".join(letters), numbers


def _flatten(value: Any, said: list[str], letters: list[str], numbers: list[Any]) -> None:
    kind = type(value)
    if kind is float or kind is np.float64:
        said.append("d")
        letters.append("d")
        numbers.append(value)
    elif issubclass(kind, tuple):
        said.append(content_of_class(kind) or _foreign())
        said.append(f"({len(value)}")
        for item in value:
            _flatten(item, said, letters, numbers)
    elif kind is bool or kind is np.bool_:
        said.append("b")
        letters.append("b")
        numbers.append(bool(value))
    elif kind is int or kind is np.int64:
        said.append("q")
        letters.append("q")
        numbers.append(int(value) if -(2**63) <= value < 2**63 else _foreign())
    elif kind is np.ndarray and value.flags.aligned and value.dtype.isnative and value.dtype.kind in "fiubc":
        flags = value.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        said.append(f"[{value.dtype.str} {value.ndim} {order} {flags.writeable}]")
        letters.append("ppqqp" + 2 * value.ndim * "q")
        numbers += (None, None, value.size, value.itemsize, value.__array_interface__["data"][0])
        numbers += value.shape
        numbers += value.strides
    else:
        _foreign()


def _foreign() -> Any:
    raise _ForeignError


def kept_form(result: Any, letters: str) -> bytes | None:
    """What is kept of a kernel that Numba has compiled without what a call from Python needs.

    Args:
        result: Numba's result of the compilation.
        letters: how its arguments are handed over, from `flattened`.

    Returns:
        None where it cannot be called without Numba: it asks for memory, gives back more than a number, raises what is
        made as it runs, or takes its arguments in another way than this version of `flattened` thinks.
    """
    given_back = _GIVEN_BACK.get(str(result.signature.return_type))
    name, library = result.fndesc.llvm_func_name, result.library
    if given_back is None or library.has_dynamic_globals or result.lifted:
        return None
    text = library.get_llvm_str()
    head = re.search(rf'^define [^\n]*@"?{re.escape(name)}"?\((.*)\)[^\n]*\{{$', text, re.MULTILINE)
    if head is None:
        return None
    taken = [_AS_LLVM_HAS_IT.get(part.split()[0], "p" if "*" in part else "?") for part in _split(head[1])]
    known = all(made == "ptr null, i32 0" for made in _WHAT_IS_RAISED.findall(text))  # no part of it is made as it runs
    machine_code = library.serialize_using_object_code()[2][0]
    called = called_by(machine_code)
    if "".join(taken) != "pp" + letters or not known or called is None or not called <= _MAY_BE_CALLED:
        return None
    said = {"name": name, "letters": letters, "gives": given_back}
    whole = json.dumps(said).encode() + b"\n" + machine_code
    return hashlib.sha256(whole).digest() + whole


def called_by(machine_code: bytes) -> set[str] | None:
    """The names that an object file of LLVM's leaves open: what must be there before it is called.

    None of a file that is neither ELF, as on Linux, nor Mach-O, as on macOS, each of 64 bits.
    """
    if machine_code.startswith(b"\x7fELF\x02\x01"):
        return _open_in_elf(machine_code)
    return _open_in_mach_o(machine_code) if machine_code.startswith(b"\xcf\xfa\xed\xfe") else None


_ELF_SECTION, _ELF_SYMBOL = struct.Struct("<IIQQQQIIQQ"), struct.Struct("<IBBHQQ")
_ELF_SYMBOLS, _ELF_OPEN = 2, 0
"""The type of a section that has symbols, and the section of one that is defined nowhere."""


def _open_in_elf(whole: bytes) -> set[str]:
    (begin,), (size, count) = struct.unpack_from("<Q", whole, 40), struct.unpack_from("<HH", whole, 58)
    sections = [_ELF_SECTION.unpack_from(whole, begin + i * size) for i in range(count)]
    found = set()
    for _, kind, _, _, place, length, names, *_ in sections:
        if kind == _ELF_SYMBOLS:
            symbols = _ELF_SYMBOL.iter_unpack(whole[place : place + length])
            found |= {_text(whole, sections[names][4] + name) for name, _, _, home, *_ in symbols if home == _ELF_OPEN}
    return found - {""}


_MACH_O_SYMBOL = struct.Struct("<IBBHQ")
_MACH_O_SYMBOLS, _MACH_O_KIND, _MACH_O_OPEN = 2, 0x0E, 0
"""The command that lists where symbols are, the bits of what one is, and those of one that is defined nowhere."""


def _open_in_mach_o(whole: bytes) -> set[str]:
    (count,), place, found = struct.unpack_from("<I", whole, 16), 32, set()
    for _ in range(count):
        command, size = struct.unpack_from("<II", whole, place)
        if command == _MACH_O_SYMBOLS:
            begin, symbols, names, _ = struct.unpack_from("<IIII", whole, place + 8)
            for name, kind, *_ in _MACH_O_SYMBOL.iter_unpack(whole[begin : begin + symbols * _MACH_O_SYMBOL.size]):
                if kind & _MACH_O_KIND == _MACH_O_OPEN:
                    found.add(_text(whole, names + name).removeprefix("_"))
        place += size
    return found


def _text(whole: bytes, place: int) -> str:
    return whole[place : whole.index(0, place)].decode()


def _split(arguments: str) -> Iterator[str]:
    """The arguments of a function in LLVM's text, at the commas that are in no bracket."""
    depth, begin = 0, 0
    for i, letter in enumerate(arguments):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            yield arguments[begin:i].strip()
            begin = i + 1
    if arguments[begin:].strip():
        yield arguments[begin:].strip()


def loaded(kept: bytes) -> Callable[[list[Any]], Any] | None:
    """The function of what `kept_form` gave: the numbers of its arguments → its result.

    None where it is torn, or calls what this process does not have.
    """
    whole = kept[_DIGEST:]
    if hashlib.sha256(whole).digest() != kept[:_DIGEST]:
        return None
    head, _, machine_code = whole.partition(b"\n")
    said = json.loads(head)
    called = called_by(machine_code)
    with _ONE_AT_A_TIME:
        llvm, engine = _llvm()
        if called is None or not all(llvm.address_of_symbol(one) for one in called):
            return None  # LLVM ends the process where it does not find a name
        engine.add_object_file(llvm.ObjectFileRef.from_data(machine_code))
        engine.finalize_object()
        address = engine.get_function_address(said["name"])
    if not address:
        return None
    numbers_of = [_WHOLE[letter] for letter in said["letters"]]
    prototype = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *numbers_of)
    function = prototype(address)
    room = _WHOLE.get(said["gives"], ctypes.c_int64)

    def call(numbers: list[Any]) -> Any:
        result, raised = room(), ctypes.c_void_p()
        if function(ctypes.addressof(result), ctypes.addressof(raised), *numbers):
            _raise(raised.value)
        return result.value if said["gives"] else None

    return call


class _Raised(ctypes.Structure):
    """What a kernel raises: its class, arguments and place, pickled when it was compiled."""

    _fields_ = (("pickled", ctypes.c_void_p), ("length", ctypes.c_int32))


def _raise(address: int | None) -> None:
    """Raise what a kernel has raised, where it did: the last frame of the traceback has its file and line.

    That of an exception that cannot be made so, too: ``raise Mine`` of one that asks for arguments.
    """
    assert address
    said = _Raised.from_address(address)
    made, arguments, place = pickle.loads(ctypes.string_at(said.pickled, said.length))
    function, file, line = place or (__name__, __file__, 1)
    code = compile("\n" * (line - 1) + "raise made(*arguments)", file, "exec")
    exec(code.replace(co_name=function), {"made": made, "arguments": arguments or ()})


_ONE_AT_A_TIME = threading.Lock()
"""Held by a thread that places machine code: an engine takes one at a time, and two engines would not both be kept."""


@cache
def _llvm() -> tuple[Any, Any]:
    """LLVM, and an engine that places machine code in memory: made as Numba makes its own."""
    llvm: Any = importlib.import_module("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if llvm.address_of_symbol(_NEVER_CALLED) is None:
        llvm.add_symbol(_NEVER_CALLED, ctypes.cast(_NO_OWNER, ctypes.c_void_p).value)
    target = llvm.Target.from_default_triple()
    relocations = "static" if target.name.startswith("x86") else "pic" if target.name.startswith("ppc") else "default"
    machine = target.create_target_machine(opt=3, reloc=relocations, codemodel="jitdefault", jit=True)
    return llvm, llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


_NO_OWNER = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(lambda owner: None)
"""In the place of `_NEVER_CALLED` where Numba is not there."""


@cache
def circumstances() -> str:
    """What machine code depends on beside its source: the processor, and the versions and options of the compiler.

    Numba is not imported for it: its version is what its file says.
    """
    llvm: Any = importlib.import_module("llvmlite.binding")
    spec = importlib.util.find_spec("numba")
    version = Path(spec.origin).with_name("_version.py") if spec and spec.origin else None
    options = sorted(f"{key}={value}" for key, value in os.environ.items() if key.startswith("NUMBA_"))
    own = Path(".numba_config.yaml")
    try:
        features = llvm.get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM does not know this processor's; Numba then compiles without any
        features = ""
    return repr(
        (
            version.read_text(encoding="utf-8") if version and version.is_file() else "",
            importlib.import_module("llvmlite").__version__,
            np.__version__,
            llvm.get_process_triple(),
            llvm.get_host_cpu_name(),
            features,
            options,
            own.read_text(encoding="utf-8") if own.is_file() else "",
        )
    )
