"""Solvers on devices: OpenCL by pyopencl, CUDA by CuPy. These packages are imported only when a device is opened."""
