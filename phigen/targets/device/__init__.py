"""The target device: one header for OpenCL, CUDA and HIP."""
