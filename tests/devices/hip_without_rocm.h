/* What the headers of ROCm give to HIP, as far as generated code needs it: clang compiles it without them. */
#define __device__ __attribute__((device))
#define __global__ __attribute__((global))
#define __shared__ __attribute__((shared))
#define __constant__ __attribute__((constant))
#define __forceinline__ inline __attribute__((always_inline))
#define __launch_bounds__(threads, blocks) __attribute__((amdgpu_flat_work_group_size(1, threads)))
#define __HIPCC_RTC__
#define NULL 0
typedef __SIZE_TYPE__ size_t;
typedef __PTRDIFF_TYPE__ ptrdiff_t;
struct index_3d {
    unsigned x, y, z;
};
extern __device__ const index_3d threadIdx, blockIdx, blockDim;
extern "C" __device__ float __int_as_float(int);
extern "C" __device__ double __longlong_as_double(long long);
#define isfinite(x) __builtin_isfinite(x)
#define fabs(x) __builtin_fabs(x)
#define floor(x) __builtin_floor(x)
#define sqrt(x) __builtin_sqrt(x)
#define fmax(x, y) __builtin_fmax(x, y)
#define fmin(x, y) __builtin_fmin(x, y)
#define copysign(x, y) __builtin_copysign(x, y)
extern "C" __device__ double cos(double), cosh(double), exp(double), expm1(double), log(double), pow(double, double);
extern "C" __device__ double sin(double), sinh(double), tan(double), tanh(double);
