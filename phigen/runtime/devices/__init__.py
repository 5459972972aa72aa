"""Solvers on devices: OpenCL by pyopencl, CUDA by CuPy. Both packages are imported only when a device is opened."""
