/* What docs/devices/cuda.cu uses of the header of HIP. */
#pragma once
#include "../device_words.h"
enum hipError_t { hipSuccess };
enum hipMemcpyKind { hipMemcpyHostToDevice, hipMemcpyDeviceToHost };
extern "C" unsigned __hipPushCallConfiguration(dim3, dim3, std::size_t = 0, void * = nullptr);
extern "C" hipError_t hipLaunchKernel(const void *, dim3, dim3, void **, std::size_t, void *);
hipError_t hipFree(void *);
hipError_t hipGetLastError();
hipError_t hipMalloc(void **, std::size_t);
hipError_t hipMemcpy(void *, const void *, std::size_t, hipMemcpyKind);
const char *hipGetErrorString(hipError_t);
