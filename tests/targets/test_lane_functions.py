"""Functions for loops over SIMD lanes agree with the library to a few units in the last place."""

import pytest
from support import run, slow_but, tool, write

from phigen.lanes.lane_functions import LANE_FORMULAS, LANE_FUNCTIONS, with_formulas
from phigen.symbolic.special import SPECIAL
from phigen.targets.c.amalgamation import Amalgam

#: Largest argument, and error in units in the last place; sums of exponentials lose one or two.
RANGES = {"log": (1e308, 2), "exp": (600.0, 2), "expm1": (600.0, 3), "sin": (1e8, 2), "cos": (1e8, 2)}
SINGLE = {"log": (3e38, 2), "exp": (80.0, 2), "expm1": (80.0, 2), "sin": (8192.0, 2), "cos": (8192.0, 2)}

#: Arguments at which functions are compared, for −1 ≤ t ≤ 1.
ARGUMENTS = {"log": "exp(LARGE * t), 1.0 + 0.5 * t * t * t", "others": "REACH * t, 3.0 * t * t * t"}

MAIN = """
#include <stdio.h>
#define REACH {reach}
#define LARGE {large}
int main(void)
{{
    double worst = 0.0;
    for (int k = -200000; k <= 200000; ++k) {{
        const double t = k / 200000.0;
        const {real} u[2] = {{ {arguments} }};
        for (int i = 0; i < 2; ++i) {{
            const double found = t_{name}_lane(u[i]), right = {name}((double)u[i]);
            worst = fmax(worst, fabs(found - right) / (fabs(right) * {epsilon} + 1e-300));
        }}
    }}
    printf("%.2f", worst);
    return !isnan(t_{name}_lane(({real})(2.0 * REACH))) || !isnan(t_{name}_lane(({real})(-2.0 * REACH)));
}}
"""


FAST = "-O3 -march=native -ffp-contract=fast"
COMPILED = [("double", FAST), ("double", "-O0"), ("float", FAST), ("float", "-O0")]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("real", "flags"), slow_but([("double", FAST), ("float", "-O0")], COMPILED))
@pytest.mark.parametrize("name", RANGES)
def test_lane_functions_agree_with_the_library(real, name, flags, tmp_path):
    """Arguments cover the whole range and, more densely, a neighbourhood of 0. Beyond the range values are NaN, so that
    steps there are computed one by one.
    """
    single = real == "float"
    reach, units = (SINGLE if single else RANGES)[name]
    switches = {f"CALLS_{f.upper()}": f == name for f in RANGES} | {"COMPOSED": True, "SINGLE": single}
    head = "#include <float.h>\n#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"
    arguments = ARGUMENTS["log" if name == "log" else "others"]
    numbers = {"real": real, "epsilon": "FLT_EPSILON" if single else "DBL_EPSILON", "large": 87.0 if single else 700.0}
    main = MAIN.format(name=name, reach=reach, arguments=arguments, **numbers)
    called = Amalgam("t", switches, {"main.c": main}).texts("lane_functions.c", "main.c")
    write(tmp_path, {"main.c": head + "".join(called)})
    run([tool("gcc"), "-std=c99", *flags.split(), "main.c", "-o", "main", "-lm"], tmp_path)
    assert float(run([tmp_path / "main"], tmp_path)) <= units


def test_every_lane_function_is_tested_or_special():
    assert set(LANE_FUNCTIONS) == {*RANGES, *SPECIAL}


@pytest.mark.parametrize("op", LANE_FORMULAS)
def test_what_formulas_call_is_emitted(op):
    called = with_formulas({op})
    assert {f for f in LANE_FUNCTIONS if f"{{{f}}}" in LANE_FORMULAS[op]} == called - {op}
