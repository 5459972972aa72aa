/* The words and objects of CUDA and HIP that generated code uses, for clang without the headers of either. */
#pragma once
#include <cmath>
#include <cstddef>
#define __device__ __attribute__((device))
#define __global__ __attribute__((global))
#define __shared__ __attribute__((shared))
#define __constant__ __attribute__((constant))
#define __forceinline__ inline __attribute__((always_inline))
#define __launch_bounds__(threads, blocks)
struct dim3 {
    unsigned x, y, z;
    constexpr dim3(unsigned n) : x(n), y(1), z(1) {}
};
struct index_3d {
    unsigned x, y, z;
};
extern __device__ const index_3d threadIdx, blockIdx, blockDim;
__device__ double fabs(double), floor(double), sqrt(double), tan(double), tanh(double);
__device__ bool isfinite(double);
