"""The target device: a single header that is valid OpenCL C, CUDA and HIP."""
