"""Solvers on devices: OpenCL by pyopencl, CUDA by CuPy. Nothing of these packages is imported otherwise."""
