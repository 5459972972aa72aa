"""Reserved identifiers of each language: its keywords, and macros of its standard headers.

A name in a spec must not equal a macro of a standard header. Otherwise generated C would not compile, or users could
not include the standard header before the header of a solver. Tests compare the lists with the compilers of the machine
that runs the tests.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Reserved:
    """Reserved names of a language: those in ``words``, and all names that match ``pattern``. The operator ``|`` adds
    words.
    """

    words: frozenset[str] = frozenset()
    pattern: re.Pattern[str] = re.compile(r"(?!)")

    def __contains__(self, name: str) -> bool:
        return name in self.words or self.pattern.fullmatch(name) is not None

    def __or__(self, words: Iterable[str]) -> Reserved:
        return Reserved(self.words | frozenset(words), self.pattern)


# -- C and C++

_C = """auto break case char const constexpr continue default do double else enum extern float for goto if inline int
long nullptr register restrict return short signed sizeof static struct switch typedef typeof typeof_unqual union
unsigned void volatile while alignas alignof and and_eq asm bitand bitor bool catch char8_t char16_t char32_t class
co_await co_return co_yield compl concept const_cast consteval constinit contract_assert decltype delete dynamic_cast
explicit export false friend mutable namespace new noexcept not not_eq operator or or_eq private protected public
reinterpret_cast requires static_assert static_cast template this thread_local throw true try typeid typename using
virtual wchar_t xor xor_eq fortran main size_t ptrdiff_t"""

# Keywords and types of OpenCL C. They are reserved in C as well, so that parameters have the same names in both
# languages.
_OPENCL = """constant event_t generic global half kernel local pipe quad read_only read_write sampler_t uchar uint ulong
uniform ushort write_only"""

# Macros of the standard headers and of headers that these include, except for the families of macros below.
_C_MACROS = """AIO_PRIO_DELTA_MAX BC_BASE_MAX BC_DIM_MAX BC_SCALE_MAX BC_STRING_MAX BIG_ENDIAN
BITINT_MAXWIDTH BUFSIZ BYTE_ORDER CHARCLASS_NAME_MAX CHAR_BIT CLOCKS_PER_SEC COLL_WEIGHTS_MAX CPU_SETSIZE CSIGNAL
DELAYTIMER_MAX DOMAIN EOF EXIT_FAILURE EXIT_SUCCESS EXPR_NEST_MAX FD_SETSIZE FILENAME_MAX FOPEN_MAX F_LOCK F_OK F_TEST
F_TLOCK F_ULOCK HOST_NAME_MAX HUGE I INFINITY IOV_MAX LINE_MAX LITTLE_ENDIAN LOGIN_NAME_MAX LONG_BIT L_INCR L_SET L_XTND
L_ctermid L_cuserid L_tmpnam MAXFLOAT MAX_CANON MAX_INPUT MB_CUR_MAX MB_LEN_MAX MINSIGSTKSZ MQ_PRIO_MAX NAME_MAX NFDBITS
NGREG NGROUPS_MAX NL_ARGMAX NL_LANGMAX NL_MSGMAX NL_NMAX NL_SETMAX NL_TEXTMAX NSIG NULL NZERO ONCE_FLAG_INIT OVERFLOW
PATH_MAX PDP_ENDIAN PIPE_BUF PLOSS P_tmpdir RAND_MAX RE_DUP_MAX RTSIG_MAX R_OK SEM_VALUE_MAX SING TLOSS TMP_MAX
TSS_DTOR_ITERATIONS TTY_NAME_MAX UNDERFLOW WCONTINUED WEOF WEXITED WNOHANG WNOWAIT WORD_BIT WSTOPPED WUNTRACED W_OK
XATTR_LIST_MAX XATTR_NAME_MAX XATTR_SIZE_MAX X_OK arm complex errno hpux i386 imaginary linux m68k
math_errhandling max min mips noreturn sa_handler sa_sigaction sched_priority sigev_notify_attributes
sigev_notify_function signgam sparc stderr stdin stdout sun unix vax"""
_WINDOWS = (
    """CONST ERROR FALSE FAR IN NEAR OPTIONAL OUT PURE THIS TRUE VOID cdecl far hyper interface near pascal small"""
)
#: Macros of windows.h and rpcndr.h that are common words. A program may include windows.h before the header of a
#: solver. For instance, the macro ``far`` is empty, so a member ``far`` of a struct would vanish.
WINDOWS_MACROS = frozenset(_WINDOWS.split())
_ERRNO = """2BIG ACCES ADDRINUSE ADDRNOTAVAIL ADV AFNOSUPPORT AGAIN ALREADY BADE BADF BADFD BADMSG BADR BADRQC BADSLT
BFONT BUSY CANCELED CHILD CHRNG COMM CONNABORTED CONNREFUSED CONNRESET DEADLK DEADLOCK DESTADDRREQ DOM DOTDOT DQUOT
EXIST FAULT FBIG HOSTDOWN HOSTUNREACH HWPOISON IDRM ILSEQ INPROGRESS INTR INVAL IO ISCONN ISDIR ISNAM KEYEXPIRED
KEYREJECTED KEYREVOKED L2HLT L2NSYNC L3HLT L3RST LIBACC LIBBAD LIBEXEC LIBMAX LIBSCN LNRNG LOOP MEDIUMTYPE MFILE MLINK
MSGSIZE MULTIHOP NAMETOOLONG NAVAIL NETDOWN NETRESET NETUNREACH NFILE NOANO NOBUFS NOCSI NODATA NODEV NOENT NOEXEC
NOKEY NOLCK NOLINK NOMEDIUM NOMEM NOMSG NONET NOPKG NOPROTOOPT NOSPC NOSR NOSTR NOSYS NOTBLK NOTCONN NOTDIR NOTEMPTY
NOTNAM NOTRECOVERABLE NOTSOCK NOTSUP NOTTY NOTUNIQ NXIO OPNOTSUPP OTHER OVERFLOW OWNERDEAD PERM PFNOSUPPORT PIPE PROTO
PROTONOSUPPORT PROTOTYPE RANGE REMCHG REMOTE REMOTEIO RESTART RFKILL ROFS SHUTDOWN SOCKTNOSUPPORT SPIPE SRCH SRMNT
STALE STRPIPE TIME TIMEDOUT TOOMANYREFS TXTBSY UCLEAN UNATCH USERS WOULDBLOCK XDEV XFULL"""

_SIGNALS = """ABRT ALRM BUS CHLD CLD CONT FPE HUP ILL INT IO IOT KILL PIPE POLL PROF PWR QUIT RTMAX RTMIN SEGV STKFLT
STKSZ STOP SYS TERM TRAP TSTP TTIN TTOU URG USR1 USR2 VTALRM WINCH XCPU XFSZ"""

_INTEGERS = r"[SU]?CHAR|U?SHRT|U?INT(\d+|MAX|PTR|_FAST\d+|_LEAST\d+)?|U?L?LONG|U?LONG_LONG|BOOL|S?SIZE|PTRDIFF"

_CONSTANTS = "E|LOG2E|LOG10E|LN2|LN10|PI|PI_2|PI_4|1_PI|2_PI|2_SQRTPI|SQRT2|SQRT1_2"
_MORE_CONSTANTS = "TWOPI|3PI_4|SQRTPI|LN2LO|LN2HI|SQRT3|IVLN10|LOG2_E|INVLN2|TAU|PHI|EGAMMA"
_PREFIXES = """DBL FLT LDBL DEC32 DEC64 DEC128 DECIMAL DEC FP FE FPE MATH LC SIG SI SA SS SIGEV ATOMIC TIME TIMER CLOCK
SEEK PTHREAD SCHED ADJ BUS CLD CLONE CLOSE_RANGE ILL MOD POLL REG RENAME SEGV STA TRAP STDIN STDOUT STDERR"""
_SIGINFO = """addr addr_lsb arch band call_addr fd int lower overrun pid pkey ptr status stime syscall timerid uid upper
utime value"""
_ATOMIC = "init|load|store|exchange|compare_exchange_strong|compare_exchange_weak|fetch_(add|and|or|sub|xor)"

#: Families of reserved names: all names with an initial underscore, and macros whose names differ in a single part.
_C_FAMILIES = (
    r"_\w*",
    rf"({_INTEGERS}|SIG_ATOMIC|WCHAR|WINT)_(MAX|MIN|WIDTH)",
    rf"({'|'.join(_PREFIXES.split())})_[A-Z]([A-Z0-9_]*[A-Z0-9])",
    rf"M_(({_CONSTANTS})(l|f\d*x?)?|{_MORE_CONSTANTS})",
    r"HUGE_VAL(F|L|_F\d+X?)?|S?NAN(F|L|F\d+X?)?",
    r"(PRI|SCN)[Xabdioux](8|16|32|64|128|MAX|PTR|FAST\d+|LEAST\d+)",
    rf"SIG({'|'.join(_SIGNALS.split())})",
    rf"si_({'|'.join(_SIGINFO.split())})",
    rf"atomic_({_ATOMIC})(_explicit)?",
    r"(bool|u?(char|short|int|long)|half|float|double)(2|3|4|8|16)",
)

#: Keywords of C and C++ up to C23 and C++26, keywords of OpenCL C, and macros of the standard headers on Linux and
#: other systems.
C_RESERVED = Reserved(
    frozenset([*_C.split(), *_OPENCL.split(), *_C_MACROS.split(), *(f"E{e}" for e in _ERRNO.split())]) | WINDOWS_MACROS,
    re.compile("|".join(_C_FAMILIES)),
)

# -- Python

_PYTHON = """False None True and as assert async await break class continue def del elif else except finally for from
global if import in is lambda nonlocal not or pass raise return try while with yield match case type np abs
print self DIM ORDER CASIMIRS DEFAULT_PARAMETERS StepError step integrate hamiltonian casimirs vector_field
OBSERVABLES observables x0 steps stride parameters _filled _sum _values"""

#: Keywords of Python, names with a special meaning in Python, and names that the generated module uses.
PYTHON_RESERVED = Reserved(frozenset(_PYTHON.split()), re.compile(r"__\w*__"))

# -- JavaScript

_JAVASCRIPT = """arguments async await break case catch class const continue debugger default delete do else enum eval
export extends false finally for function get if implements import in instanceof interface let new null of package
private protected public return set static super switch this throw true try typeof undefined var void while with yield
__proto__ constructor globalThis Array Error Float64Array Infinity Math NaN Number Object"""

#: Keywords in JavaScript modules, names with a special meaning in objects, and globals that generated code may use.
JAVASCRIPT_RESERVED = Reserved(frozenset(_JAVASCRIPT.split()))
