/* What docs/devices/cuda.cu uses of the header of CUDA. */
#pragma once
#define __CUDACC__
#include "device_words.h"
enum cudaError_t { cudaSuccess };
enum cudaMemcpyKind { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost };
extern "C" unsigned __cudaPushCallConfiguration(dim3, dim3, std::size_t = 0, void * = nullptr);
extern "C" cudaError_t cudaLaunchKernel(const void *, dim3, dim3, void **, std::size_t, void *);
cudaError_t cudaFree(void *);
cudaError_t cudaGetLastError();
cudaError_t cudaMalloc(void **, std::size_t);
cudaError_t cudaMemcpy(void *, const void *, std::size_t, cudaMemcpyKind);
const char *cudaGetErrorString(cudaError_t);
