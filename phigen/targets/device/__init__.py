"""The target ``device``: generated code in one header that is valid OpenCL C, CUDA and HIP."""
