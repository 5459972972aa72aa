"""The function φ(s) = (1 − w cot w)/s, w = √s/2, and derivatives on devices, run by OpenCL on the processor; the code
calls no tangent of the library.
"""

import mpmath
import numpy as np
import pytest
from support import COMMAND, compile_text

import phigen
from phigen.compiler import emit
from phigen.runtime.devices import opencl
from phigen.symbolic import special
from phigen.targets.special import turns

pytest.importorskip("pyopencl")

BODY = """
coordinates: [x1, x2, x3]
poisson:
  brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}
hamiltonian: (x1**2 + x2**2/2 + x3**2/3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
order: 2
"""

KERNEL = """
t_KERNEL void t_values_kernel(int items, t_GLOBAL const double *s, t_GLOBAL double *out)
{
    const int k = (int)t_WORK_ITEM;
    if (k >= items) return;
    out[2 * k] = t_phi0(s[k]);
    out[2 * k + 1] = t_phi1(s[k]);
}
"""


@pytest.mark.parametrize("real", ["double", pytest.param("float", marks=pytest.mark.slow)])
def test_functions_of_phi_are_accurate_up_to_the_limit_of_their_range(real):
    (text,) = emit(compile_text(f"{BODY}real: {real}\n").program, "device", COMMAND).values()
    assert "tan(" not in text.replace("tanh(", "")
    device, kind = opencl.device(), np.dtype(np.float32 if real == "float" else np.float64)
    kernel = device.kernel(device.compiled(text + KERNEL.replace("double", real), {}), "t_values_kernel")
    limit = float(str(turns(single=real == "float")["limit"]))
    points = np.array([-1e4, -17, -3, 0.1, 7, 15.9, 16.1, 30, 39.4, 39.6, 88.8, 157, 5e3, 1e6, 1e10], kind)
    s = np.append(points, np.array([limit, 1.01 * limit, np.inf, np.nan], kind))
    out, buffers = np.zeros((len(s), 2), kind), [device.empty(s.nbytes), device.empty(2 * s.nbytes)]
    device.write(buffers[0], s)
    device.launch(kernel, len(s), [np.int32(len(s)), *buffers])
    device.read(buffers[1], out)
    assert np.isnan(out[-3:]).all()
    assert np.isfinite(out[:-3]).all()
    with mpmath.workdps(40):
        for value, row in zip(points, out, strict=False):
            w = mpmath.sqrt(abs(value)) / 2
            condition = 1 + (abs(w / mpmath.sin(w)) if value > 16 else 0)  # condition number of cot
            for order, term in ((0, 0), (1, 0.125 / abs(value))):  # rounding of the term 1/(8s) in φ′
                expected = special.precisely(mpmath.mp, order, mpmath.mpf(float(value)))
                bound = 40 * condition ** (order + 1) * abs(expected) + 4 * term
                assert abs(row[order] - expected) < np.finfo(kind).eps * bound


def test_members_beyond_the_range_have_a_status():
    """A member that rotates by 10⁸ radians in a step is beyond the range of φ on devices: C makes the step, and devices
    report the member as failed.
    """
    compilation = compile_text(BODY)
    device, c = (phigen.compile(compilation, target, profile="small") for target in ("opencl", "c"))
    x0 = np.array([[0.0, 0, 1], [0, 0, 1e9], [0.0, 0, 2]])
    np.testing.assert_allclose(c.ensemble(x0, 0.1, 3), x0)
    with pytest.raises(phigen.StepError) as raised:
        device.ensemble(x0, 0.1, 3)
    assert raised.value.members == (1,)
    assert raised.value.status == "NOT_FINITE"
    np.testing.assert_array_equal(raised.value.trajectory, x0)
