// An ensemble of rigid bodies by CUDA or HIP:
//     nvcc -O3 --fmad=false -I generated/rigid_body cuda.cu -o cuda
//     hipcc -O3 -ffp-contract=off -I generated/rigid_body -x hip cuda.cu -o hip
#include <cstdio>
#include <cstdlib>
#ifdef __HIP__
#include <hip/hip_runtime.h>
#define cudaError_t hipError_t
#define cudaFree hipFree
#define cudaGetErrorString hipGetErrorString
#define cudaGetLastError hipGetLastError
#define cudaMalloc hipMalloc
#define cudaMemcpy hipMemcpy
#define cudaMemcpyDeviceToHost hipMemcpyDeviceToHost
#define cudaMemcpyHostToDevice hipMemcpyHostToDevice
#define cudaSuccess hipSuccess
#else
#include <cuda_runtime.h>
#endif

#include "rigid_body_device.h"

constexpr int MEMBERS = 1000, STEPS = 200;

static void check(cudaError_t error, const char *call)
{
    if (error == cudaSuccess) return;
    std::fprintf(stderr, "%s: %s\n", call, cudaGetErrorString(error));
    std::exit(1);
}

// Memory of the device with a copy of an array.
template <class Number> static Number *copied(const Number *values, int count)
{
    void *memory = nullptr;
    check(cudaMalloc(&memory, count * sizeof *values), "cudaMalloc");
    check(cudaMemcpy(memory, values, count * sizeof *values, cudaMemcpyHostToDevice), "cudaMemcpy");
    return static_cast<Number *>(memory);
}

int main()
{
    static double x[rigid_body_DIM * MEMBERS];
    static unsigned char status[MEMBERS];
    const double h = 0.1;
    for (int m = 0; m < MEMBERS; ++m) {
        x[m] = 0.01 + 1e-5 * m;
        x[MEMBERS + m] = 1.0;
        x[2 * MEMBERS + m] = 0.01;
    }
    rigid_body_params *params = copied(&rigid_body_default_params, 1);
    double *states = copied(x, rigid_body_DIM * MEMBERS), *size = copied(&h, 1);
    unsigned char *ended = copied(status, MEMBERS);

    // params, gauge and h are for all members, and there are no frames.
    const int block = rigid_body_GROUP, blocks = (MEMBERS + block - 1) / block;
    rigid_body_ensemble_kernel<<<blocks, block>>>(
        MEMBERS, params, 0, states, nullptr, 0, size, 0, STEPS, 1, nullptr, ended);
    check(cudaGetLastError(), "rigid_body_ensemble_kernel");
    check(cudaMemcpy(x, states, sizeof x, cudaMemcpyDeviceToHost), "cudaMemcpy");
    check(cudaMemcpy(status, ended, sizeof status, cudaMemcpyDeviceToHost), "cudaMemcpy");
    for (int m = 0; m < MEMBERS; m += 333)
        std::printf("%4d: status %d, %.15g %.15g %.15g\n", m, status[m], x[m], x[MEMBERS + m], x[2 * MEMBERS + m]);
    check(cudaFree(params), "cudaFree");
    check(cudaFree(states), "cudaFree");
    check(cudaFree(size), "cudaFree");
    check(cudaFree(ended), "cudaFree");
}
