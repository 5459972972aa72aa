"""Names that a spec must not have.

The name of a spec is that of the generated files NAME.h and NAME.py, and the prefix of generated symbols, such as
NAME_init. If other code needs a header or module called NAME, the generated file would hide that header or module on a
search path. The generated symbols must not clash with symbols of libraries or of other specs.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable

_C = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
bool true false nullptr constexpr thread_local alignas alignof static_assert typeof typeof_unqual"""
_CPP = """and and_eq asm bitand bitor catch char8_t char16_t char32_t class compl concept consteval constinit
const_cast co_await co_return co_yield decltype delete dynamic_cast explicit export friend mutable namespace new
noexcept not not_eq operator or or_eq private protected public reinterpret_cast requires static_cast template this
throw try typeid typename using virtual wchar_t xor xor_eq"""
_PYTHON = """and as assert async await break class continue def del elif else except finally for from global if
import in is lambda nonlocal not or pass raise return try while with yield match type"""
_KEYWORDS = frozenset(f"{_C} {_CPP} {_PYTHON}".split())

# Headers of standard C, of POSIX, of the libraries of Linux, macOS and Windows, and of compilers. Other headers include
# them as <NAME.h>. The names are in lower case: on some file systems, the file availability.h is also found by the name
# <Availability.h>.
_HEADERS = """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg
stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype
aio aliases alloca ar argp argz backtrace byteswap cpio crypt cxxabi dirent dlfcn elf endian envz err error execinfo
fcntl features fmtmsg fnmatch fpu_control fstab fts ftw gconv getopt glob grp gshadow iconv ieee754 ifaddrs langinfo
lastlog libgen libintl libio link malloc mcheck memory mntent monetary mqueue ndbm netdb nl_types nss obstack paths poll
printf proc_service pthread pty pwd re_comp regex regexp resolv sched search semaphore sgtty shadow spawn stab stdio_ext
strings stropts syscall sysexits syslog tar termio termios thread_db trace ttyent ucontext ulimit unistd ustat utime
utmp utmpx values varargs wait wordexp xlocale availability block altivec builtins cet cpuid gcov intrin msa omp openacc
quadmath stdfix syslimits unwind vadefs mm_malloc mm3dnow conio corecrt crtdbg crtdefs direct dos eh fibersapi io
mbctype mbstring minmax minwindef process sal share tchar vcruntime winbase windef windows winerror winnt winsock
winsock2"""
_HEADER_FAMILIES = r"\w+intrin|(arm|hexagon|hvx|riscv|wasm)_\w+|ncurses\w*|curses"
_HEADER = re.compile(rf"{'|'.join(_HEADERS.split())}|{_HEADER_FAMILIES}")

# _MODULES: modules that programs import together with a generated module. _OTHER_VERSIONS: modules of the standard
# library that only some versions of Python have.
_MODULES = frozenset(["numpy", "scipy", "sympy", "matplotlib", "pandas", "phigen"])
_OTHER_VERSIONS = frozenset(["annotationlib", "asynchat", "asyncore", "compression", "distutils", "imp", "smtpd"])

_DEVICE = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]")

# Names X for which a C library has functions X_init, X_status, …. If X were the name of a spec, programs that are
# linked with the generated code would call the generated functions instead.
_LIBRARY = re.compile(r"pthread_\w+|posix_\w+|inet6_\w+|argp_err_exit|acc|atomic|cnd|fanotify|inotify|mtx|res|sem|si")

#: The name of a spec must not end in an underscore and one of these words. For example, a spec NAME generates the
#: symbol NAME_default_params for its default parameters. A spec NAME_default would generate the same symbol for the
#: type of its parameters. The value of each word is the part of the symbol after NAME_.
CLASHING_ENDS = {
    "default": "default_params",
    "modified": "modified_hamiltonian",
    "put": "put_planes",
    "set": "set_attitude",
}

_HIDES = "would hide {} of that name from what is compiled or imported beside the solver"
_REASONS: tuple[tuple[Callable[[str], object], str], ...] = (
    (_KEYWORDS.__contains__, "is a keyword of C, C++ or Python"),
    (_HEADER.fullmatch, _HIDES.format("the header")),
    ((sys.stdlib_module_names | _MODULES | _OTHER_VERSIONS).__contains__, _HIDES.format("the Python module")),
    (_DEVICE.fullmatch, "cannot be that of a file on Windows"),
    (_LIBRARY.fullmatch, "begins functions of the C library, such as {name}_init"),
)


def objection(name: str) -> tuple[str, str] | None:
    """Return the reason why a well-formed name is refused for a spec, and a hint; None if the name is allowed."""
    for refuses, reason in _REASONS:
        if refuses(name):
            return f"the spec name {name!r} {reason.format(name=name)}", f"{name}_system would do"
    head, _, end = name.rpartition("_")
    if head and end in CLASHING_ENDS:
        message = f"the spec name {name!r} would clash with a spec {head!r}, whose code has {head}_{CLASHING_ENDS[end]}"
        return message, f"{name}_system would do, or {end}_{head}"
    return None
